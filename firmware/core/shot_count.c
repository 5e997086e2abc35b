#include "shot_count.h"

#include "port.h"

static uint32_t lights_of(const struct pulse_train *train)
{
    uint32_t lights = 0;
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++)
        if (train->channels[i].used && train->channels[i].current_ma)
            lights |= 1u << i;
    return lights;
}

void shot_count_fired(struct generator *generator)
{
    const uint64_t now_us = port_now_us();
    generator->counters.fired++;
    generator->fired = true;
    generator->permitted = false;
    generator->shot_lights |= lights_of(&generator->train);
    generator->not_before_us = now_us + channel_limits_period_us(&generator->train, generator->limits);
    /* Both terms are rounded down. */
    generator->train_over_us = now_us + pulse_train_length_ns(&generator->train) / 1000u + 2u;
    if (--generator->shots_left == 0)
        generator->state = STATE_SAFE; /* generator_poll switches the outputs off once this train is over */
}

void shot_count_collect(struct generator *generator)
{
    if (generator->state != STATE_ARMED || generator->source != SOURCE_EXTERNAL)
        return;
    const struct port_edges edges = port_take_edges();
    const uint32_t fired = edges.fired;
    const uint32_t ignored = edges.rises > fired ? edges.rises - fired : 0;
    generator->counters.requested += fired + ignored;
    generator->counters.suppressed += ignored;
    generator->counters.early += ignored;
    if (fired)
        shot_count_fired(generator);
}
