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

bool channel_limits_are_within_absolute(const struct channel_limits *limits)
{
    for (int i = 0; i < CHANNEL_COUNT; i++)
        if (limits[i].max_current_ma > MAX_CURRENT_MA || limits[i].max_duty_ppm > MAX_DUTY_PPM ||
            limits[i].max_light_ma > MAX_LIGHT_MA)
            return false;
    return true;
}

void channel_limits_tighten(struct channel_limits *present, const struct channel_limits *asked)
{
    present->max_current_ma = smaller(present->max_current_ma, asked->max_current_ma);
    present->max_duty_ppm = smaller(present->max_duty_ppm, asked->max_duty_ppm);
    present->max_light_ma = smaller(present->max_light_ma, asked->max_light_ma);
}

bool channel_limits_allow(uint32_t current_ma, const struct channel_limits *limits)
{
    return !current_ma || (current_ma <= limits->max_current_ma && limits->max_duty_ppm > 0);
}

bool channel_limits_allow_train(const struct pulse_train *train, const struct channel_limits *limits)
{
    for (int i = 0; i < CHANNEL_COUNT; i++)
        if (train->channels[i].used && !channel_limits_allow(train->channels[i].current_ma, &limits[i]))
            return false;
    return true;
}

bool channel_limits_allow_light(uint32_t current_ma, const struct channel_limits *limits)
{
    return channel_limits_allow(current_ma, limits) && current_ma <= limits->max_light_ma;
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

uint32_t channel_limits_longest_us(const struct channel_limits *limits)
{
    uint32_t tightest_ppm = MAX_DUTY_PPM;
    for (int i = 0; i < CHANNEL_COUNT; i++)
        if (limits[i].max_duty_ppm)
            tightest_ppm = smaller(tightest_ppm, limits[i].max_duty_ppm);
    return (2u * MAX_WIDTH_NS * 1000u + tightest_ppm - 1u) / tightest_ppm;
}
