/* The pulse train of one shot: values, limits, quantisation. Pure; all times in ns from the trigger of the shot.
 * A channel gives two light pulses, or one: then start and width of B are 0. */
#ifndef PULSE_TRAIN_H
#define PULSE_TRAIN_H

#include <stdbool.h>
#include <stdint.h>

#include "error.h"
#include "limits.h"

struct channel {
    uint32_t camera_ns; /* rising edge of the camera trigger */
    uint32_t a_start_ns;
    uint32_t a_width_ns;
    uint32_t b_start_ns;
    uint32_t b_width_ns;
    uint32_t current_ma;       /* 0: the camera is triggered, no light */
    uint32_t frame_a_close_ns; /* from the camera trigger, not from the trigger of the shot */
    uint32_t frame_b_open_ns;  /* likewise */
    uint32_t used;             /* 0 or 1; all are words, for sum.h */
};

struct pulse_train {
    struct channel channels[CHANNEL_COUNT];
};

/* First limit that the channel breaks, or ERROR_NONE. Safe for any field values. */
enum error pulse_train_check_channel(const struct channel *channel);

/* Every edge and width at the nearest multiple of the tick, the current at the next lower one of its step. Only for a
 * channel that passed the check. */
struct channel pulse_train_quantised(const struct channel *channel, uint32_t tick_ns, uint32_t step_ma);

/* Whether it gives pulse A alone. */
bool pulse_train_is_single(const struct channel *channel);

/* ERROR_NO_TRAIN if no channel is used, else the first limit that a used channel breaks. */
enum error pulse_train_check(const struct pulse_train *train);

/* Trigger of the shot until the last output has fallen. */
uint32_t pulse_train_length_ns(const struct pulse_train *train);

#endif
