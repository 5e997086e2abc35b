/* Absolute limits. They are compiled in: nothing on the wire can widen them.
 * firmware/README.md lists the same numbers; a test compares the two. */
#ifndef LIMITS_H
#define LIMITS_H

#include <stdint.h>

enum limits {
    CHANNEL_COUNT = 4,
    MIN_WIDTH_NS = 200,
    MAX_WIDTH_NS = 2000,
    MIN_DARK_NS = 400,          /* end of pulse A to start of pulse B: the LED driver recovers */
    MAX_SEPARATION_NS = 200000, /* start of pulse A to start of pulse B */
    MAX_EDGE_NS = 20000000,     /* latest rising edge after the trigger of the shot */
    MAX_CURRENT_MA = 30000,
    MIN_PERIOD_US = 10000,
    MAX_PERIOD_US = 10000000,
    MAX_DUTY_PPM = 200, /* light on per channel; lengthens the period above 2 us of light per shot */
    MAX_SHOTS = 1000000,
    HEARTBEAT_MS = 3000,
    CAMERA_PULSE_NS = 10000, /* how long a camera trigger stays high */
    MAX_LIGHT_MA = 500,      /* continuous light */
    MAX_LIGHT_MS = 600000,
    MAX_LIGHT_DUTY_PPM = 50000, /* it is made of pulses of at most MAX_WIDTH_NS; this part of the time they are on */
    LIGHT_SUSTAIN_MS = 60,      /* it ends by itself if the core does not ask for more */
    SETTLE_MS = 20,             /* from the set-points of pulses to those of continuous light */
    MAX_LINE = 128,             /* characters of a request, CRC included, line feed excluded */
};

/* What the arithmetic of pulse_train.c relies on. */
_Static_assert(MAX_WIDTH_NS + MIN_DARK_NS < MAX_SEPARATION_NS, "two pulses fit the longest separation");
_Static_assert((uint64_t)MAX_EDGE_NS + MAX_WIDTH_NS + CAMERA_PULSE_NS < UINT32_MAX, "edges fit 32 bits");
_Static_assert(2ull * MAX_WIDTH_NS * 1000u / MAX_DUTY_PPM >= MIN_PERIOD_US,
               "a start waits for the period of any train");
_Static_assert(2ull * MAX_WIDTH_NS * 1000u < UINT32_MAX, "the duty sum fits 32 bits");
_Static_assert(MAX_LIGHT_MS * 1000ull < UINT32_MAX, "and the time of continuous light, in us");

#endif
