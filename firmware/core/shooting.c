#include "shooting.h"

#include "port.h"

static enum error check_period(const struct safety *safety, enum source source, uint32_t period_us)
{
    if (!period_us && source != SOURCE_TIMER)
        return ERROR_NONE;
    const uint32_t shortest_us = train_period_us(&safety->train, safety->limits);
    return period_us >= shortest_us && period_us <= MAX_PERIOD_US ? ERROR_NONE : ERROR_PERIOD;
}

static enum error arm_permission(struct safety *safety, uint32_t shots, uint32_t source, uint32_t period_us)
{
    enum error error = safety_check_safe(safety);
    if (!error)
        error = safety_check_stops(safety);
    if (error)
        return error;
    if (!safety->loaded)
        return ERROR_NO_TRAIN;
    if (shots < 1 || shots > MAX_SHOTS)
        return ERROR_SHOTS;
    return source > SOURCE_TIMER ? ERROR_SOURCE : check_period(safety, (enum source)source, period_us);
}

enum error safety_arm(struct safety *safety, uint32_t shots, uint32_t source, uint32_t period_us)
{
    const enum error error = arm_permission(safety, shots, source, period_us);
    if (error)
        return error;
    safety->outputs_live = true; /* also where only a part can be loaded */
    if (!port_load(&safety->train)) {
        safety_outputs_off(safety);
        return ERROR_HARDWARE;
    }
    safety->source = (enum source)source;
    safety->timer_period_us = period_us;
    safety->timer_due_us = later_us(port_now_us() + period_us, safety->not_before_us);
    safety->shots_left = shots;
    safety->state = STATE_ARMED;
    return ERROR_NONE;
}

static enum error fire_permission(struct safety *safety)
{
    if (safety->state == STATE_FAULT)
        return ERROR_FAULT_LATCHED;
    if (safety->state != STATE_ARMED)
        return ERROR_NOT_ARMED;
    const enum error error = safety_check_stops(safety);
    if (error)
        return error;
    if (safety_check_train(safety) || !safety->shots_left) {
        safety_trip(safety, FAULT_INTERNAL); /* both were checked when arming: memory has changed since */
        return ERROR_FAULT_LATCHED;
    }
    return port_now_us() < safety->not_before_us ? ERROR_EARLY : ERROR_NONE;
}

/* After the start: starting takes time, and the end must not be cut off. */
static void count_shot(struct safety *safety)
{
    const uint64_t now_us = port_now_us();
    safety->counters.fired++;
    safety->fired = true;
    safety->permitted = false;
    safety->not_before_us = now_us + train_period_us(&safety->train, safety->limits);
    safety->train_over_us = now_us + train_length_ns(&safety->train) / 1000u + 2u; /* both terms are rounded down */
    if (--safety->shots_left == 0)
        safety->state = STATE_SAFE; /* safety_poll switches the outputs off once this train is over */
}

/* An interrupt has switched the outputs off before the shot could start: a stop, or the abort byte. */
static enum error interrupted(struct safety *safety)
{
    (void)safety_check_stops(safety);
    safety_off(safety);
    return safety->state == STATE_FAULT ? ERROR_FAULT_LATCHED : ERROR_NOT_ARMED;
}

static enum error start(struct safety *safety)
{
    const enum error error = fire_permission(safety);
    if (error)
        return error;
    return port_fire() ? ERROR_NONE : interrupted(safety);
}

static enum error shoot(struct safety *safety, enum source source)
{
    safety->counters.requested++;
    const bool other = safety->state == STATE_ARMED && safety->source != source;
    const enum error error = other ? ERROR_OTHER_SOURCE : start(safety);
    if (error) {
        safety->counters.suppressed++;
        safety->counters.early += error == ERROR_EARLY;
        return error;
    }
    count_shot(safety);
    return ERROR_NONE;
}

enum error safety_fire(struct safety *safety)
{
    return shoot(safety, SOURCE_COMMAND);
}

void shooting_collect(struct safety *safety)
{
    if (safety->state != STATE_ARMED || safety->source != SOURCE_EXTERNAL)
        return;
    const struct port_edges edges = port_take_edges();
    const uint32_t fired = edges.fired;
    const uint32_t ignored = edges.rises > fired ? edges.rises - fired : 0;
    safety->counters.requested += fired + ignored;
    safety->counters.suppressed += ignored;
    safety->counters.early += ignored;
    if (fired)
        count_shot(safety);
}

static void permit(struct safety *safety)
{
    if (safety->state == STATE_ARMED && !safety->permitted && fire_permission(safety) == ERROR_NONE) {
        port_permit();
        safety->permitted = true;
    }
}

static void run_timer(struct safety *safety)
{
    const uint64_t now_us = port_now_us();
    if (now_us < safety->timer_due_us)
        return;
    (void)shoot(safety, SOURCE_TIMER); /* refused: counted */
    const uint64_t next_us = safety->timer_due_us + safety->timer_period_us;
    safety->timer_due_us =
        later_us(next_us > now_us ? next_us : now_us + safety->timer_period_us, safety->not_before_us);
}

void shooting_poll(struct safety *safety)
{
    if (safety->state != STATE_ARMED)
        return;
    if (safety->source == SOURCE_EXTERNAL) {
        shooting_collect(safety);
        permit(safety);
    } else if (safety->source == SOURCE_TIMER) {
        run_timer(safety);
    }
}

uint64_t shooting_due_us(const struct safety *safety)
{
    if (safety->state == STATE_ARMED && safety->source == SOURCE_TIMER)
        return safety->timer_due_us;
    if (safety->state == STATE_ARMED && safety->source == SOURCE_EXTERNAL && !safety->permitted)
        return safety->not_before_us;
    return UINT64_MAX;
}
