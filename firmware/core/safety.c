#include "safety.h"

#include "port.h"
#include "shot_count.h"
#include "sum.h"

static void wait_as_after_any_light(struct generator *generator)
{
    const uint64_t over_us = port_now_us() + channel_limits_longest_us(generator->limits);
    generator->not_before_us = later_us(generator->not_before_us, over_us);
}

/* Dark first. Then what the trigger input had started before is counted, and the waiting times begin. */
void safety_outputs_off(struct generator *generator)
{
    port_off();
    shot_count_collect(generator);
    if (generator->outputs_live)
        generator->settled_us = port_now_us() + SETTLE_MS * 1000u;
    if (generator->state == STATE_LIT)
        wait_as_after_any_light(generator);
    generator->outputs_live = false;
    generator->permitted = false;
    generator->shots_left = 0;
}

void safety_trip(struct generator *generator, enum fault fault)
{
    safety_outputs_off(generator);
    generator->faults |= (uint32_t)fault;
    generator->state = STATE_FAULT;
}

static bool gives_light(const struct generator *generator)
{
    return generator->state == STATE_ARMED || generator->state == STATE_LIT;
}

enum error safety_check_stops(struct generator *generator)
{
    generator->estop_closed = port_estop_closed();
    generator->interlock_closed = port_interlock_closed();
    const bool lights = gives_light(generator); /* before the first of two trips */
    if (!generator->estop_closed && !(generator->faults & FAULT_ESTOP))
        safety_trip(generator, FAULT_ESTOP);
    if (!generator->interlock_closed && lights)
        safety_trip(generator, FAULT_INTERLOCK);
    if (!generator->estop_closed)
        return ERROR_ESTOP_OPEN;
    return generator->interlock_closed ? ERROR_NONE : ERROR_INTERLOCK_OPEN;
}

enum error safety_check_safe(const struct generator *generator)
{
    if (generator->state == STATE_FAULT)
        return ERROR_FAULT_LATCHED;
    return generator->state == STATE_SAFE ? ERROR_NONE : ERROR_NOT_SAFE;
}

static bool train_is_sound(const struct generator *generator)
{
    return sum_of(&generator->train, sizeof generator->train) == generator->train_sum;
}

static bool limits_are_sound(const struct generator *generator)
{
    return sum_of(generator->limits, sizeof generator->limits) == generator->limits_sum;
}

bool safety_check_memory(struct generator *generator)
{
    const bool sound = train_is_sound(generator) && limits_are_sound(generator);
    if (!sound)
        safety_trip(generator, FAULT_INTERNAL);
    return sound;
}

static void forget_train(struct generator *generator)
{
    generator->train = (struct pulse_train){0};
    generator->train_sum = sum_of(&generator->train, sizeof generator->train);
    generator->loaded = generator->fired = false;
}

void safety_start_limits(struct generator *generator)
{
    generator->stored = stored_limits_read(generator->limits);
    generator->limits_sum = sum_of(generator->limits, sizeof generator->limits);
    wait_as_after_any_light(generator);
    forget_train(generator);
    if (generator->stored == STORED_DAMAGED)
        safety_trip(generator, FAULT_LIMITS);
}

enum error safety_new_train(struct generator *generator)
{
    const enum error error = safety_check_safe(generator);
    if (error)
        return error;
    forget_train(generator);
    return ERROR_NONE;
}

enum error safety_set_channel(struct generator *generator, uint32_t number, const struct channel *requested)
{
    enum error error = safety_check_safe(generator);
    if (error)
        return error;
    if (number >= CHANNEL_COUNT)
        return ERROR_CHANNEL;
    if (!safety_check_memory(generator))
        return ERROR_FAULT_LATCHED;
    error = pulse_train_check_channel(requested);
    if (error)
        return error;
    if (!channel_limits_allow(requested->current_ma, &generator->limits[number]))
        return ERROR_LIMIT;
    struct channel actual = pulse_train_quantised(requested, port_tick_ns, port_current_step_ma);
    error = pulse_train_check_channel(&actual);
    if (error)
        return error;
    actual.used = true;
    generator->train.channels[number] = actual;
    generator->train_sum = sum_of(&generator->train, sizeof generator->train);
    generator->loaded = generator->fired = false;
    return ERROR_NONE;
}

/* The absolute limits and those of the channels, which may have been tightened since a channel was set. */
enum error safety_check_train(const struct generator *generator)
{
    const enum error error = pulse_train_check(&generator->train);
    if (error)
        return error;
    return channel_limits_allow_train(&generator->train, generator->limits) ? ERROR_NONE : ERROR_LIMIT;
}

enum error safety_load(struct generator *generator)
{
    enum error error = safety_check_safe(generator);
    if (error)
        return error;
    if (!safety_check_memory(generator))
        return ERROR_FAULT_LATCHED;
    error = safety_check_train(generator);
    if (error)
        return error;
    generator->loaded = true;
    generator->train_id++;
    return ERROR_NONE;
}

enum error safety_tighten(struct generator *generator, uint32_t number, const struct channel_limits *asked)
{
    if (gives_light(generator))
        return ERROR_NOT_SAFE;
    if (number >= CHANNEL_COUNT)
        return ERROR_CHANNEL;
    if (!safety_check_memory(generator))
        return ERROR_FAULT_LATCHED;
    channel_limits_tighten(&generator->limits[number], asked);
    generator->limits_sum = sum_of(generator->limits, sizeof generator->limits);
    generator->loaded = false;
    return ERROR_NONE;
}

enum error safety_check_dark(const struct generator *generator)
{
    if (gives_light(generator))
        return ERROR_NOT_SAFE;
    return generator->outputs_live ? ERROR_EARLY : ERROR_NONE;
}

enum error safety_store_limits(struct generator *generator, const struct channel_limits *limits)
{
    const enum error error = safety_check_dark(generator);
    if (error)
        return error;
    if (!channel_limits_are_within_absolute(limits))
        return ERROR_STORE;
    if (!safety_check_memory(generator))
        return ERROR_FAULT_LATCHED;
    stored_limits_write(limits);
    safety_start_limits(generator);
    return generator->limits_sum == sum_of(limits, sizeof generator->limits) ? ERROR_NONE : ERROR_HARDWARE;
}

void safety_off(struct generator *generator)
{
    safety_outputs_off(generator);
    if (generator->state != STATE_FAULT)
        generator->state = STATE_SAFE;
}

enum error safety_clear(struct generator *generator)
{
    if (gives_light(generator))
        return ERROR_NOT_SAFE;
    const enum error error = safety_check_stops(generator);
    if (error)
        return error;
    if (!port_set_points_confirmed() || port_take_lights() || !port_intact() || !port_clock_sound() ||
        !limits_are_sound(generator) || generator->stored == STORED_DAMAGED)
        return ERROR_HARDWARE;
    if (!train_is_sound(generator))
        forget_train(generator);
    generator->faults = 0;
    generator->state = STATE_SAFE;
    return ERROR_NONE;
}

enum error safety_made_ready(struct generator *generator, bool ready)
{
    const enum error error = safety_check_stops(generator);
    if (error || ready)
        return error;
    safety_off(generator);
    return ERROR_HARDWARE;
}

void safety_heard(struct generator *generator)
{
    generator->heard_us = port_now_us();
}

void safety_hung_up(struct generator *generator)
{
    if (gives_light(generator))
        safety_trip(generator, FAULT_HEARTBEAT);
    else
        safety_outputs_off(generator);
}

void safety_watch(struct generator *generator, uint64_t now_us)
{
    const bool lights = gives_light(generator); /* before the first of several trips: all causes are named */
    (void)safety_check_stops(generator);
    if (!port_set_points_confirmed() && !(generator->faults & FAULT_SETPOINT))
        safety_trip(generator, FAULT_SETPOINT);
    if (!port_intact() && !(generator->faults & FAULT_INTERNAL))
        safety_trip(generator, FAULT_INTERNAL);
    if (!port_clock_sound() && !(generator->faults & FAULT_CLOCK))
        safety_trip(generator, FAULT_CLOCK);
    if (lights && now_us - generator->heard_us > HEARTBEAT_MS * 1000u)
        safety_trip(generator, FAULT_HEARTBEAT);
}
