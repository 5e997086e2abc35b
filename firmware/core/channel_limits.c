#include "channel_limits.h"

#include "limits.h"

enum { START_US = 10 }; /* more than it takes to start a shot */

static uint32_t smaller(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

struct channel_limits channel_limits_absolute(void)
{
    return (struct channel_limits){
        .max_current_ma = MAX_CURRENT_MA, .max_duty_ppm = MAX_DUTY_PPM, .max_light_ma = MAX_LIGHT_MA};
}

struct channel_limits channel_limits_tightened(struct channel_limits present, struct channel_limits asked)
{
    return (struct channel_limits){
        .max_current_ma = smaller(present.max_current_ma, asked.max_current_ma),
        .max_duty_ppm = smaller(present.max_duty_ppm, asked.max_duty_ppm),
        .max_light_ma = smaller(present.max_light_ma, asked.max_light_ma),
    };
}

bool channel_limits_allow(const struct channel *channel, const struct channel_limits *limits)
{
    if (!channel->current_ma)
        return true;
    return channel->current_ma <= limits->max_current_ma && limits->max_duty_ppm > 0;
}

bool channel_limits_allow_train(const struct pulse_train *train, const struct channel_limits *limits)
{
    for (int i = 0; i < CHANNEL_COUNT; i++)
        if (train->channels[i].used && !channel_limits_allow(&train->channels[i], &limits[i]))
            return false;
    return true;
}

bool channel_limits_allow_light(uint32_t current_ma, const struct channel_limits *limits)
{
    const struct channel_limits light = {smaller(limits->max_current_ma, limits->max_light_ma), limits->max_duty_ppm,
                                         0};
    return channel_limits_allow(&(struct channel){.current_ma = current_ma}, &light);
}

static uint32_t channel_period_us(const struct channel *channel, uint32_t max_duty_ppm)
{
    if (!channel->used || !channel->current_ma)
        return 0;
    const uint32_t lit_ns = channel->a_width_ns + channel->b_width_ns;
    return (lit_ns * 1000u + max_duty_ppm - 1u) / max_duty_ppm;
}

uint32_t channel_limits_period_us(const struct pulse_train *train, const struct channel_limits *limits)
{
    const uint32_t busy_us = pulse_train_length_ns(train) / 1000u + START_US;
    uint32_t period_us = busy_us > MIN_PERIOD_US ? busy_us : MIN_PERIOD_US;
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        const uint32_t needed_us = channel_period_us(&train->channels[i], limits[i].max_duty_ppm);
        if (needed_us > period_us)
            period_us = needed_us;
    }
    return period_us;
}
