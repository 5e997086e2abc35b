#include "safety.h"

#include "light.h"
#include "port.h"
#include "shooting.h"

/* Dark first. Then what the trigger input had started before is counted, and the waiting times begin. */
void safety_outputs_off(struct safety *safety)
{
    port_off();
    shooting_collect(safety);
    const uint64_t now_us = port_now_us();
    if (safety->outputs_live)
        safety->settled_us = now_us + SETTLE_MS * 1000u;
    if (safety->state == STATE_LIT)
        safety->not_before_us = later_us(safety->not_before_us, now_us + LONGEST_PERIOD_US);
    safety->outputs_live = false;
    safety->permitted = false;
    safety->shots_left = 0;
}

void safety_trip(struct safety *safety, enum fault fault)
{
    safety_outputs_off(safety);
    safety->faults |= (uint32_t)fault;
    safety->state = STATE_FAULT;
}

static bool gives_light(const struct safety *safety)
{
    return safety->state == STATE_ARMED || safety->state == STATE_LIT;
}

enum error safety_check_stops(struct safety *safety)
{
    safety->estop_closed = port_estop_closed();
    safety->interlock_closed = port_interlock_closed();
    const bool lights = gives_light(safety); /* before the first of two trips */
    if (!safety->estop_closed && !(safety->faults & FAULT_ESTOP))
        safety_trip(safety, FAULT_ESTOP);
    if (!safety->interlock_closed && lights)
        safety_trip(safety, FAULT_INTERLOCK);
    if (!safety->estop_closed)
        return ERROR_ESTOP_OPEN;
    return safety->interlock_closed ? ERROR_NONE : ERROR_INTERLOCK_OPEN;
}

enum error safety_check_safe(const struct safety *safety)
{
    if (safety->state == STATE_FAULT)
        return ERROR_FAULT_LATCHED;
    return safety->state == STATE_SAFE ? ERROR_NONE : ERROR_NOT_SAFE;
}

void safety_boot(struct safety *safety, enum cause cause)
{
    const uint64_t now_us = port_now_us();
    *safety = (struct safety){.state = STATE_SAFE, .not_before_us = now_us + LONGEST_PERIOD_US};
    for (int i = 0; i < CHANNEL_COUNT; i++)
        safety->limits[i] = channel_limits_absolute();
    safety_outputs_off(safety);
    if (cause == CAUSE_WATCHDOG)
        safety_trip(safety, FAULT_WATCHDOG);
}

enum error safety_new_train(struct safety *safety)
{
    const enum error error = safety_check_safe(safety);
    if (error)
        return error;
    safety->train = (struct pulse_train){0};
    safety->loaded = safety->fired = false;
    return ERROR_NONE;
}

enum error safety_set_channel(struct safety *safety, uint32_t number, const struct channel *requested)
{
    enum error error = safety_check_safe(safety);
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
    safety->loaded = safety->fired = false;
    return ERROR_NONE;
}

/* The absolute limits and those of the channels, which may have been tightened since a channel was set. */
enum error safety_check_train(const struct safety *safety)
{
    const enum error error = train_check(&safety->train);
    if (error)
        return error;
    return train_within(&safety->train, safety->limits) ? ERROR_NONE : ERROR_LIMIT;
}

enum error safety_load(struct safety *safety)
{
    enum error error = safety_check_safe(safety);
    if (!error)
        error = safety_check_train(safety);
    if (error)
        return error;
    safety->loaded = true;
    safety->train_id++;
    return ERROR_NONE;
}

enum error safety_tighten(struct safety *safety, uint32_t number, struct channel_limits asked)
{
    if (gives_light(safety))
        return ERROR_NOT_SAFE;
    if (number >= CHANNEL_COUNT)
        return ERROR_CHANNEL;
    safety->limits[number] = channel_limits_tightened(safety->limits[number], asked);
    safety->loaded = false;
    return ERROR_NONE;
}

void safety_off(struct safety *safety)
{
    safety_outputs_off(safety);
    if (safety->state != STATE_FAULT)
        safety->state = STATE_SAFE;
}

enum error safety_clear(struct safety *safety)
{
    if (gives_light(safety))
        return ERROR_NOT_SAFE;
    const enum error error = safety_check_stops(safety);
    if (error)
        return error;
    if (!port_set_points_confirmed())
        return ERROR_HARDWARE;
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
    (void)safety_check_stops(safety); /* what it finds, it latches */
    if (!port_set_points_confirmed() && !(safety->faults & FAULT_SETPOINT))
        safety_trip(safety, FAULT_SETPOINT);
    safety->counters.cameras += port_take_cameras();
    if (gives_light(safety) && now_us - safety->heard_us > HEARTBEAT_MS * 1000u)
        safety_trip(safety, FAULT_HEARTBEAT);
    shooting_poll(safety);
    light_poll(safety);
    if (safety->state == STATE_SAFE && safety->outputs_live && now_us >= safety->train_over_us)
        safety_outputs_off(safety);
}

uint32_t safety_idle_us(const struct safety *safety)
{
    const uint64_t now_us = port_now_us();
    const uint64_t due_us = shooting_due_us(safety);
    if (due_us <= now_us)
        return 0;
    return due_us - now_us < POLL_US ? (uint32_t)(due_us - now_us) : (uint32_t)POLL_US;
}
