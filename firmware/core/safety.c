#include "safety.h"

#include "port.h"

/* Of any train within the absolute limits. A start waits as long, because it has forgotten what was fired before. */
enum { LONGEST_PERIOD_US = 2 * MAX_WIDTH_NS * 1000 / MAX_DUTY_PPM };

static void outputs_off(struct safety *safety)
{
    port_off();
    safety->outputs_live = false;
    safety->shots_left = 0;
}

static void trip(struct safety *safety, enum fault fault)
{
    outputs_off(safety);
    safety->faults |= (uint32_t)fault;
    safety->state = STATE_FAULT;
}

bool safety_interlock_closed(struct safety *safety)
{
    const bool closed = port_interlock_closed();
    if (!closed && safety->state == STATE_ARMED)
        trip(safety, FAULT_INTERLOCK);
    return closed;
}

static enum error must_be_safe(const struct safety *safety)
{
    if (safety->state == STATE_FAULT)
        return ERROR_FAULT_LATCHED;
    return safety->state == STATE_SAFE ? ERROR_NONE : ERROR_NOT_SAFE;
}

void safety_boot(struct safety *safety, bool watchdog)
{
    *safety = (struct safety){.state = STATE_SAFE, .not_before_us = port_now_us() + LONGEST_PERIOD_US};
    for (int i = 0; i < CHANNEL_COUNT; i++)
        safety->limits[i] = channel_limits_absolute();
    outputs_off(safety);
    if (watchdog)
        trip(safety, FAULT_WATCHDOG);
}

enum error safety_new_train(struct safety *safety)
{
    const enum error error = must_be_safe(safety);
    if (error)
        return error;
    safety->train = (struct pulse_train){0};
    safety->loaded = false;
    return ERROR_NONE;
}

enum error safety_set_channel(struct safety *safety, uint32_t number, const struct channel *requested)
{
    enum error error = must_be_safe(safety);
    if (error)
        return error;
    if (number >= CHANNEL_COUNT)
        return ERROR_CHANNEL;
    error = channel_check(requested);
    if (error)
        return error;
    if (!channel_within(requested, &safety->limits[number]))
        return ERROR_LIMIT;
    struct channel actual = channel_quantised(requested, port_tick_ns);
    error = channel_check(&actual);
    if (error)
        return error;
    actual.used = true;
    safety->train.channels[number] = actual;
    safety->loaded = false;
    return ERROR_NONE;
}

/* The absolute limits and those of the channels, which may have been tightened since a channel was set. */
static enum error check_train(const struct safety *safety)
{
    const enum error error = train_check(&safety->train);
    if (error)
        return error;
    return train_within(&safety->train, safety->limits) ? ERROR_NONE : ERROR_LIMIT;
}

enum error safety_load(struct safety *safety)
{
    enum error error = must_be_safe(safety);
    if (!error)
        error = check_train(safety);
    if (error)
        return error;
    safety->loaded = true;
    safety->train_id++;
    return ERROR_NONE;
}

enum error safety_tighten(struct safety *safety, uint32_t number, struct channel_limits asked)
{
    if (safety->state == STATE_ARMED)
        return ERROR_NOT_SAFE;
    if (number >= CHANNEL_COUNT)
        return ERROR_CHANNEL;
    safety->limits[number] = channel_limits_tightened(safety->limits[number], asked);
    safety->loaded = false;
    return ERROR_NONE;
}

static enum error arm_permission(struct safety *safety, uint32_t shots)
{
    const enum error error = must_be_safe(safety);
    if (error)
        return error;
    if (!safety_interlock_closed(safety))
        return ERROR_INTERLOCK_OPEN;
    if (!safety->loaded)
        return ERROR_NO_TRAIN;
    return shots >= 1 && shots <= MAX_SHOTS ? ERROR_NONE : ERROR_SHOTS;
}

enum error safety_arm(struct safety *safety, uint32_t shots)
{
    const enum error error = arm_permission(safety, shots);
    if (error)
        return error;
    if (!port_load(&safety->train)) {
        outputs_off(safety);
        return ERROR_HARDWARE;
    }
    safety->outputs_live = true;
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
    if (!safety_interlock_closed(safety))
        return ERROR_INTERLOCK_OPEN;
    if (check_train(safety) || !safety->shots_left) {
        trip(safety, FAULT_INTERNAL); /* both were checked when arming: memory has changed since */
        return ERROR_FAULT_LATCHED;
    }
    return port_now_us() < safety->not_before_us ? ERROR_EARLY : ERROR_NONE;
}

enum error safety_fire(struct safety *safety)
{
    safety->counters.requested++;
    const enum error error = fire_permission(safety);
    if (error) {
        safety->counters.suppressed++;
        safety->counters.early += error == ERROR_EARLY;
        return error;
    }
    safety->counters.fired++;
    port_fire();
    const uint64_t now_us = port_now_us(); /* after it: starting takes time, and the end must not be cut off */
    safety->not_before_us = now_us + train_period_us(&safety->train, safety->limits);
    safety->train_over_us = now_us + train_length_ns(&safety->train) / 1000u + 2u; /* both terms are rounded down */
    if (--safety->shots_left == 0)
        safety->state = STATE_SAFE; /* safety_poll switches the outputs off once this train is over */
    return ERROR_NONE;
}

void safety_off(struct safety *safety)
{
    outputs_off(safety);
    if (safety->state == STATE_ARMED)
        safety->state = STATE_SAFE;
}

enum error safety_clear(struct safety *safety)
{
    if (safety->state == STATE_ARMED)
        return ERROR_NOT_SAFE;
    if (!safety_interlock_closed(safety))
        return ERROR_INTERLOCK_OPEN;
    safety->faults = 0;
    safety->state = STATE_SAFE;
    return ERROR_NONE;
}

void safety_heard(struct safety *safety)
{
    safety->heard_us = port_now_us();
}

void safety_poll(struct safety *safety)
{
    const uint64_t now_us = port_now_us();
    safety_interlock_closed(safety);
    if (safety->state == STATE_ARMED && now_us - safety->heard_us > HEARTBEAT_MS * 1000u)
        trip(safety, FAULT_HEARTBEAT);
    if (safety->state == STATE_SAFE && safety->outputs_live && now_us >= safety->train_over_us)
        outputs_off(safety);
}
