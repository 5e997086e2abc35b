#include "shooting.h"

#include "port.h"
#include "safety.h"
#include "shot_count.h"

static enum error check_period(const struct generator *generator, enum source source, uint32_t period_us)
{
    if (!period_us && source != SOURCE_TIMER)
        return ERROR_NONE;
    const uint32_t shortest_us = channel_limits_period_us(&generator->train, generator->limits);
    return period_us >= shortest_us && period_us <= MAX_PERIOD_US ? ERROR_NONE : ERROR_PERIOD;
}

/* Memory has changed since the train was loaded, or it has not. */
static bool train_is_sound(struct generator *generator)
{
    if (!safety_check_memory(generator))
        return false;
    if (!safety_check_train(generator))
        return true;
    safety_trip(generator, FAULT_INTERNAL);
    return false;
}

static enum error arm_permission(struct generator *generator, uint32_t shots, uint32_t source, uint32_t period_us)
{
    enum error error = safety_check_safe(generator);
    if (!error)
        error = safety_check_stops(generator);
    if (error)
        return error;
    if (!generator->loaded)
        return ERROR_NO_TRAIN;
    if (!train_is_sound(generator))
        return ERROR_FAULT_LATCHED;
    if (shots < 1 || shots > MAX_SHOTS)
        return ERROR_SHOTS;
    error = source > SOURCE_TIMER ? ERROR_SOURCE : check_period(generator, (enum source)source, period_us);
    if (error)
        return error;
    return generator->outputs_live ? ERROR_EARLY : ERROR_NONE; /* the last train may still be under way */
}

enum error shooting_arm(struct generator *generator, uint32_t shots, uint32_t source, uint32_t period_us)
{
    const enum error error = arm_permission(generator, shots, source, period_us);
    if (error)
        return error;
    generator->outputs_live = true; /* also where only a part can be loaded */
    generator->source = (enum source)source;
    generator->shots_left = shots;
    generator->state = STATE_ARMED;
    const bool ready = port_load(&generator->train);
    generator->timer_period_us = period_us;
    generator->timer_due_us = later_us(port_now_us() + period_us, generator->not_before_us);
    return safety_made_ready(generator, ready);
}

static enum error fire_permission(struct generator *generator)
{
    if (generator->state == STATE_FAULT)
        return ERROR_FAULT_LATCHED;
    if (generator->state != STATE_ARMED)
        return ERROR_NOT_ARMED;
    const enum error error = safety_check_stops(generator);
    const bool sound = train_is_sound(generator);
    if (error)
        return error;
    if (!sound)
        return ERROR_FAULT_LATCHED;
    if (!generator->shots_left) {
        safety_trip(generator, FAULT_INTERNAL); /* it was checked when arming */
        return ERROR_FAULT_LATCHED;
    }
    return port_now_us() < generator->not_before_us ? ERROR_EARLY : ERROR_NONE;
}

/* An interrupt has switched the outputs off before the shot could start: a stop, or the abort byte. */
static enum error interrupted(struct generator *generator)
{
    (void)safety_check_stops(generator);
    safety_off(generator);
    return generator->state == STATE_FAULT ? ERROR_FAULT_LATCHED : ERROR_NOT_ARMED;
}

static enum error start(struct generator *generator)
{
    const enum error error = fire_permission(generator);
    if (error)
        return error;
    return port_fire() ? ERROR_NONE : interrupted(generator);
}

static enum error shoot(struct generator *generator, enum source source)
{
    generator->counters.requested++;
    const bool other = generator->state == STATE_ARMED && generator->source != source;
    const enum error error = other ? ERROR_OTHER_SOURCE : start(generator);
    if (error) {
        generator->counters.suppressed++;
        generator->counters.early += error == ERROR_EARLY;
        return error;
    }
    shot_count_fired(generator);
    return ERROR_NONE;
}

enum error shooting_fire(struct generator *generator)
{
    return shoot(generator, SOURCE_COMMAND);
}

static void permit(struct generator *generator)
{
    if (generator->state == STATE_ARMED && !generator->permitted && fire_permission(generator) == ERROR_NONE) {
        port_permit();
        generator->permitted = true;
    }
}

static void run_timer(struct generator *generator)
{
    const uint64_t now_us = port_now_us();
    if (now_us < generator->timer_due_us)
        return;
    (void)shoot(generator, SOURCE_TIMER); /* refused: counted */
    const uint64_t next_us = generator->timer_due_us + generator->timer_period_us;
    generator->timer_due_us =
        later_us(next_us > now_us ? next_us : now_us + generator->timer_period_us, generator->not_before_us);
}

void shooting_poll(struct generator *generator)
{
    if (generator->state != STATE_ARMED)
        return;
    if (generator->source == SOURCE_EXTERNAL) {
        shot_count_collect(generator);
        permit(generator);
    } else if (generator->source == SOURCE_TIMER) {
        run_timer(generator);
    }
}

uint64_t shooting_due_us(const struct generator *generator)
{
    if (generator->state == STATE_ARMED && generator->source == SOURCE_TIMER)
        return generator->timer_due_us;
    if (generator->state == STATE_ARMED && generator->source == SOURCE_EXTERNAL && !generator->permitted)
        return generator->not_before_us;
    return UINT64_MAX;
}
