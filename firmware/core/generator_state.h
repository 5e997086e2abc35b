/* The state of the generator, which safety, shooting, light and shot_count work on.
 *
 *            shooting_arm               stop opens, host silent, memory corrupt
 *     SAFE ───────────────▶ ARMED ─────────────────────────────────────────────▶ FAULT
 *      ▲ ◀─────────────────── │                                                    │
 *      │  off, last shot fired                                                     │
 *      │     light_start                                                           │
 *      │ ─────────────────▶ LIT ──────────────────────────────────────────────────▶│
 *      │ ◀─────────────────── │                                                    │
 *      │  off, time is over                                                        │
 *      └──────────────────────── safety_clear, stops closed ───────────────────────┘
 *
 * Nothing but shooting_arm leads to ARMED, nothing but light_start to LIT. The emergency stop, and set-points that are
 * not known to be zero, a light output that is high for no reason and a changed memory lead to FAULT from everywhere. */
#ifndef GENERATOR_STATE_H
#define GENERATOR_STATE_H

#include <stdbool.h>
#include <stdint.h>

#include "channel_limits.h"
#include "pulse_train.h"
#include "stored_limits.h"

enum state {
    STATE_SAFE = 0,
    STATE_ARMED = 1,
    STATE_FAULT = 2,
    STATE_LIT = 3,
};

/* Latched causes; a bit mask. */
enum fault {
    FAULT_INTERLOCK = 1,
    FAULT_HEARTBEAT = 2,
    FAULT_WATCHDOG = 4,
    FAULT_INTERNAL = 8,
    FAULT_ESTOP = 16,
    FAULT_SETPOINT = 32,
    FAULT_OUTPUT = 64,
    FAULT_LIMITS = 128,
    FAULT_CLOCK = 256,
};

/* What starts the shots of an armed generator. */
enum source {
    SOURCE_COMMAND = 0,
    SOURCE_EXTERNAL = 1,
    SOURCE_TIMER = 2,
};

/* Why the microcontroller has started. */
enum cause {
    CAUSE_UNKNOWN = 0,
    CAUSE_POWER = 1,
    CAUSE_PIN = 2,
    CAUSE_DEBUG = 3,
    CAUSE_WATCHDOG = 4,
    CAUSE_SOFTWARE = 5,
};

/* Since boot. requested == fired + suppressed, always; early is the part of suppressed that came too soon. */
struct counters {
    uint32_t requested;
    uint32_t fired;
    uint32_t suppressed;
    uint32_t early;
    uint32_t cameras;
    uint32_t lights;
    uint32_t crc_errors;
};

struct generator {
    enum state state;
    uint32_t faults;
    bool interlock_closed; /* as the port told it last */
    bool estop_closed;
    enum stored stored; /* what was found in the memory of the board */
    struct channel_limits limits[CHANNEL_COUNT];
    uint32_t limits_sum;      /* of what safety.c has written there */
    struct pulse_train train; /* actual values */
    uint32_t train_sum;       /* likewise */
    bool loaded;
    bool fired; /* the train as it is now is that of the newest shot */
    bool outputs_live;
    uint32_t train_id; /* counts the trains loaded since boot */
    enum source source;
    uint32_t shots_left;
    bool permitted; /* the trigger input may start a shot */
    uint32_t timer_period_us;
    uint64_t timer_due_us;
    struct counters counters;
    uint64_t not_before_us; /* the next light */
    uint64_t train_over_us; /* the latest one */
    uint64_t settled_us;    /* the set-points that pulses had */
    uint64_t light_over_us;
    uint32_t shot_lights; /* bits of the light outputs that the newest shot uses, until its train is over */
    uint32_t seen_lights; /* those of them that were seen high */
    uint32_t lit_lights;  /* likewise, of continuous light */
    uint64_t heard_us;    /* last command of the host that was carried out */
};

static inline uint64_t later_us(uint64_t a_us, uint64_t b_us)
{
    return a_us > b_us ? a_us : b_us;
}

#endif
