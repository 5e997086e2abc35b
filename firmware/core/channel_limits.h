/* Limits of one channel while the generator runs, for the LED that is connected to it. They start at those
 * that the board has stored, or at the absolute ones of limits.h, and can only be tightened, until the next start. */
#ifndef CHANNEL_LIMITS_H
#define CHANNEL_LIMITS_H

#include <stdbool.h>
#include <stdint.h>

#include "pulse_train.h"

struct channel_limits {
    uint32_t max_current_ma;
    uint32_t max_duty_ppm; /* of the pulses; 0: no light at all */
    uint32_t max_light_ma; /* continuous light */
};

struct channel_limits channel_limits_absolute(void);

/* Of all channels. */
bool channel_limits_are_within_absolute(const struct channel_limits *limits);

/* The tighter of both, field by field. */
void channel_limits_tighten(struct channel_limits *present, const struct channel_limits *asked);

/* Whether a channel may give pulses of this current. */
bool channel_limits_allow(uint32_t current_ma, const struct channel_limits *limits);

/* False if a used channel of the train is not within its limits. */
bool channel_limits_allow_train(const struct pulse_train *train, const struct channel_limits *limits);

/* Whether a channel may give continuous light of this current. */
bool channel_limits_allow_light(uint32_t current_ma, const struct channel_limits *limits);

/* Shortest time to the next shot, so that no channel exceeds its duty over any length of time: the minimum period,
 * the light of this shot at the duty of its channel, or the shot itself. For a train within these limits. */
uint32_t channel_limits_period_us(const struct pulse_train *train, const struct channel_limits *limits);

/* Of any train within these limits of all channels: what has forgotten the light before it waits as long. */
uint32_t channel_limits_longest_us(const struct channel_limits *limits);

#endif
