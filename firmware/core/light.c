#include "light.h"

#include "port.h"

static enum error check_currents(const struct safety *safety, const uint32_t *current_ma)
{
    uint32_t sum_ma = 0;
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        if (current_ma[i] > MAX_LIGHT_MA)
            return ERROR_LIGHT;
        if (!light_within(current_ma[i], &safety->limits[i]))
            return ERROR_LIMIT;
        sum_ma += current_ma[i];
    }
    return sum_ma ? ERROR_NONE : ERROR_LIGHT;
}

static enum error light_permission(struct safety *safety, uint32_t time_ms, const uint32_t *current_ma)
{
    enum error error = safety_check_safe(safety);
    if (!error)
        error = safety_check_stops(safety);
    if (error)
        return error;
    if (time_ms < 1 || time_ms > MAX_LIGHT_MS)
        return ERROR_LIGHT;
    error = check_currents(safety, current_ma);
    if (error)
        return error;
    const uint64_t now_us = port_now_us();
    const bool quiet = !safety->outputs_live && now_us >= safety->not_before_us && now_us >= safety->settled_us;
    return quiet ? ERROR_NONE : ERROR_EARLY;
}

enum error safety_light(struct safety *safety, uint32_t time_ms, const uint32_t *current_ma)
{
    const enum error error = light_permission(safety, time_ms, current_ma);
    if (error)
        return error;
    safety->outputs_live = true; /* also where only a part can be prepared */
    if (!port_prepare_light(current_ma)) {
        safety_outputs_off(safety);
        return ERROR_HARDWARE;
    }
    safety->light_over_us = port_now_us() + time_ms * 1000u;
    safety->state = STATE_LIT; /* safety_poll lights */
    return ERROR_NONE;
}

void light_poll(struct safety *safety)
{
    if (safety->state != STATE_LIT)
        return;
    if (port_now_us() >= safety->light_over_us)
        safety_off(safety);
    else
        port_sustain_light();
}
