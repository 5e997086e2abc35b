/* Whether light is allowed: states, faults, and the inputs and events that take the permission away.
 * What gives light is in shooting.h and light.h; nothing else does.
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
 * not known to be zero, lead to FAULT from everywhere. */
#ifndef SAFETY_H
#define SAFETY_H

#include <stdbool.h>
#include <stdint.h>

#include "channel_limits.h"
#include "pulse_train.h"

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
    uint32_t crc_errors;
};

struct generator {
    enum state state;
    uint32_t faults;
    bool interlock_closed; /* as the port told it last */
    bool estop_closed;
    struct channel_limits limits[CHANNEL_COUNT];
    struct pulse_train train; /* actual values */
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
    uint64_t heard_us; /* last valid line of the host */
};

/* Of any train within the absolute limits: what has forgotten the light before it waits as long. */
enum { LONGEST_PERIOD_US = 2 * MAX_WIDTH_NS * 1000 / MAX_DUTY_PPM };

/* Safe, or FAULT if the watchdog caused this boot. */
void safety_boot(struct generator *generator, enum cause cause);

/* Loading: only while SAFE. Quantises, checks requested and actual values, keeps the actual ones. */
enum error safety_new_train(struct generator *generator);
enum error safety_set_channel(struct generator *generator, uint32_t number, const struct channel *requested);
enum error safety_load(struct generator *generator);

/* Tighten the limits of a channel; what is larger than the present limit changes nothing. The train must be loaded
 * again. Not while ARMED or LIT. */
enum error safety_tighten(struct generator *generator, uint32_t number, struct channel_limits asked);

void safety_off(struct generator *generator);
enum error safety_clear(struct generator *generator);

/* The host has sent a valid line. */
void safety_heard(struct generator *generator);

/* Watch inputs and host, do what is due; call it at least every few milliseconds. */
void safety_poll(struct generator *generator);

/* Time until safety_poll has something to do, at most POLL_US. */
enum { POLL_US = 2000 };
uint32_t safety_idle_us(const struct generator *generator);

static inline uint64_t later_us(uint64_t a_us, uint64_t b_us)
{
    return a_us > b_us ? a_us : b_us;
}

/* For shooting.c and light.c. All reading of the stops goes through here: the port tells each opening once. */
enum error safety_check_safe(const struct generator *generator);
enum error safety_check_stops(struct generator *generator);
enum error safety_check_train(const struct generator *generator);
void safety_outputs_off(struct generator *generator);
void safety_trip(struct generator *generator, enum fault fault);

#endif
