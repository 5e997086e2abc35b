#include "pulse_train.h"

static uint32_t larger(uint32_t a, uint32_t b)
{
    return a > b ? a : b;
}

static bool width_allowed(uint32_t width_ns)
{
    return width_ns >= MIN_WIDTH_NS && width_ns <= MAX_WIDTH_NS;
}

bool pulse_train_is_single(const struct channel *channel)
{
    return !channel->b_start_ns && !channel->b_width_ns;
}

static bool widths_allowed(const struct channel *channel)
{
    return width_allowed(channel->a_width_ns) && (pulse_train_is_single(channel) || width_allowed(channel->b_width_ns));
}

static bool separation_allowed(const struct channel *channel)
{
    if (pulse_train_is_single(channel))
        return true;
    /* Sums of bounded values: edges and widths were checked before. */
    const uint32_t a_end_ns = channel->a_start_ns + channel->a_width_ns;
    return channel->b_start_ns >= a_end_ns + MIN_DARK_NS &&
           channel->b_start_ns - channel->a_start_ns <= MAX_SEPARATION_NS;
}

static bool straddles(const struct channel *channel)
{
    /* The frame boundaries are any 32 bit numbers. */
    const uint64_t a_close_ns = (uint64_t)channel->camera_ns + channel->frame_a_close_ns;
    const uint64_t b_open_ns = (uint64_t)channel->camera_ns + channel->frame_b_open_ns;
    if ((uint64_t)channel->a_start_ns + channel->a_width_ns > a_close_ns)
        return false;
    return pulse_train_is_single(channel) || (a_close_ns <= b_open_ns && channel->b_start_ns >= b_open_ns);
}

enum error pulse_train_check_channel(const struct channel *channel)
{
    if (channel->camera_ns > MAX_EDGE_NS || channel->a_start_ns > MAX_EDGE_NS || channel->b_start_ns > MAX_EDGE_NS)
        return ERROR_EDGE;
    if (!widths_allowed(channel))
        return ERROR_WIDTH;
    if (!separation_allowed(channel))
        return ERROR_SEPARATION;
    if (channel->current_ma > MAX_CURRENT_MA)
        return ERROR_CURRENT;
    return straddles(channel) ? ERROR_NONE : ERROR_STRADDLE;
}

static uint32_t nearest(uint32_t ns, uint32_t tick_ns)
{
    return (ns + tick_ns / 2u) / tick_ns * tick_ns;
}

struct channel pulse_train_quantised(const struct channel *channel, uint32_t tick_ns, uint32_t step_ma)
{
    struct channel actual = *channel;
    actual.camera_ns = nearest(channel->camera_ns, tick_ns);
    actual.a_start_ns = nearest(channel->a_start_ns, tick_ns);
    actual.a_width_ns = nearest(channel->a_width_ns, tick_ns);
    actual.b_start_ns = nearest(channel->b_start_ns, tick_ns);
    actual.b_width_ns = nearest(channel->b_width_ns, tick_ns);
    actual.current_ma = channel->current_ma / step_ma * step_ma;
    return actual;
}

enum error pulse_train_check(const struct pulse_train *train)
{
    enum error error = ERROR_NO_TRAIN;
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        if (!train->channels[i].used)
            continue;
        error = pulse_train_check_channel(&train->channels[i]);
        if (error)
            return error;
    }
    return error;
}

uint32_t pulse_train_length_ns(const struct pulse_train *train)
{
    uint32_t length_ns = 0;
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        const struct channel *channel = &train->channels[i];
        if (!channel->used)
            continue;
        length_ns = larger(length_ns, channel->camera_ns + CAMERA_PULSE_NS);
        length_ns = larger(length_ns, channel->a_start_ns + channel->a_width_ns);
        length_ns = larger(length_ns, channel->b_start_ns + channel->b_width_ns);
    }
    return length_ns;
}
