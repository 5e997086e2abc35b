#include "light.h"

#include "port.h"
#include "safety.h"

static enum error check_currents(const struct generator *generator, const uint32_t *current_ma)
{
    uint32_t sum_ma = 0;
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        if (current_ma[i] > MAX_LIGHT_MA)
            return ERROR_LIGHT;
        if (!channel_limits_allow_light(current_ma[i], &generator->limits[i]))
            return ERROR_LIMIT;
        sum_ma += current_ma[i];
    }
    return sum_ma ? ERROR_NONE : ERROR_LIGHT;
}

static enum error light_permission(struct generator *generator, uint32_t time_ms, const uint32_t *current_ma)
{
    enum error error = safety_check_safe(generator);
    if (!error)
        error = safety_check_stops(generator);
    if (error)
        return error;
    if (!safety_check_memory(generator))
        return ERROR_FAULT_LATCHED;
    if (time_ms < 1 || time_ms > MAX_LIGHT_MS)
        return ERROR_LIGHT;
    error = check_currents(generator, current_ma);
    if (error)
        return error;
    const uint64_t now_us = port_now_us();
    const bool quiet =
        !generator->outputs_live && now_us >= generator->not_before_us && now_us >= generator->settled_us;
    return quiet ? ERROR_NONE : ERROR_EARLY;
}

enum error light_start(struct generator *generator, uint32_t time_ms, const uint32_t *requested_ma)
{
    uint32_t current_ma[CHANNEL_COUNT];
    for (int i = 0; i < CHANNEL_COUNT; i++)
        current_ma[i] = requested_ma[i] / port_current_step_ma * port_current_step_ma;
    enum error error = light_permission(generator, time_ms, requested_ma);
    if (!error)
        error = check_currents(generator, current_ma);
    if (error)
        return error;
    generator->outputs_live = true; /* also where only a part can be prepared */
    generator->state = STATE_LIT;   /* generator_poll lights */
    const bool ready = port_prepare_light(current_ma);
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++)
        generator->lit_lights |= current_ma[i] ? 1u << i : 0u;
    generator->light_over_us = port_now_us() + time_ms * 1000u;
    return safety_made_ready(generator, ready);
}

void light_poll(struct generator *generator)
{
    if (generator->state != STATE_LIT)
        return;
    if (port_now_us() >= generator->light_over_us)
        safety_off(generator);
    else
        port_sustain_light();
}
