/* Whether light is allowed. Every path to port_fire leads through safety_fire.
 *
 *            safety_arm                 interlock opens, host silent, memory corrupt
 *     SAFE ───────────────▶ ARMED ─────────────────────────────────────────────▶ FAULT
 *      ▲ ◀─────────────────── │                                                    │
 *      │  off, last shot fired                                                     │
 *      └──────────────────────── safety_clear, interlock closed ───────────────────┘
 *
 * Nothing but safety_arm leads to ARMED. */
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
};

/* Latched causes; a bit mask. */
enum fault {
    FAULT_INTERLOCK = 1,
    FAULT_HEARTBEAT = 2,
    FAULT_WATCHDOG = 4,
    FAULT_INTERNAL = 8,
};

/* Since boot. requested == fired + suppressed, always; early is the part of suppressed that came too soon. */
struct counters {
    uint32_t requested;
    uint32_t fired;
    uint32_t suppressed;
    uint32_t early;
    uint32_t crc_errors;
};

struct safety {
    enum state state;
    uint32_t faults;
    struct channel_limits limits[CHANNEL_COUNT];
    struct pulse_train train; /* actual values */
    bool loaded;
    bool outputs_live;
    uint32_t train_id; /* counts the trains loaded since boot */
    uint32_t shots_left;
    struct counters counters;
    uint64_t not_before_us;   /* the next shot */
    uint64_t train_over_us;   /* the latest one */
    uint64_t heard_us;        /* last valid line of the host */
};

/* Safe, or FAULT if the watchdog caused this boot. */
void safety_boot(struct safety *safety, bool watchdog);

/* Loading: only while SAFE. Quantises, checks requested and actual values, keeps the actual ones. */
enum error safety_new_train(struct safety *safety);
enum error safety_set_channel(struct safety *safety, uint32_t number, const struct channel *requested);
enum error safety_load(struct safety *safety);

/* Tighten the limits of a channel; what is larger than the present limit changes nothing. The train must be loaded
 * again. Not while ARMED. */
enum error safety_tighten(struct safety *safety, uint32_t number, struct channel_limits asked);

enum error safety_arm(struct safety *safety, uint32_t shots);
enum error safety_fire(struct safety *safety);
void safety_off(struct safety *safety);
enum error safety_clear(struct safety *safety);

/* Reads the interlock input; an opening while armed trips. All reading goes through here: the port tells each once. */
bool safety_interlock_closed(struct safety *safety);

/* The host has sent a valid line. */
void safety_heard(struct safety *safety);

/* Watch interlock and host; call it at least every few milliseconds. */
void safety_poll(struct safety *safety);

#endif
