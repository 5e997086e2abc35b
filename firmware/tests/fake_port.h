/* A port for the tests: everything the core asks of it can be set or read here. */
#ifndef FAKE_PORT_H
#define FAKE_PORT_H

#include <stdio.h>
#include <stdlib.h>

#include "port.h"
#include "protocol.h"

enum {
    FIRING_US = 3, /* time that port_fire takes; the light may start at its end */
    REPLY_SIZE = 512,
    LONGEST_PERIOD_US = 20000, /* 2 pulses of 2 us at 200 ppm */
};

struct fake_port {
    uint64_t now_us;
    bool interlock_closed;
    bool estop_closed;
    bool can_load;
    bool set_points_stuck; /* cannot be confirmed as zero */
    bool *opens;           /* a stop that opens while the next train or light is made ready, which fails then */
    bool interrupted;      /* an interrupt switches the outputs off just before the next shot */
    struct pulse_train loaded;
    bool live; /* between port_load and port_off */
    bool permitted;
    bool edge_fired;  /* since the core last asked */
    uint32_t rises;   /* likewise */
    uint32_t cameras; /* likewise */
    uint32_t lights;  /* bits of those that were high, likewise */
    uint32_t stuck_lights;
    bool damaged; /* the memory of the program */
    bool clock_wrong;
    unsigned stores; /* how often the core has stored */
    uint32_t stored[STORED_WORDS];
    bool any_stored;
    bool store_is_full;
    bool store_damages;
    struct port_line_errors line_errors;
    uint32_t light_ma[CHANNEL_COUNT];
    bool prepared; /* for light */
    uint64_t lit_until_us;
    unsigned fired;
    unsigned replies;
    char reply[REPLY_SIZE]; /* newest, terminated by zero */
    unsigned fired_before_sending;
    size_t sending; /* bytes of the one that is on its way */
};

extern struct fake_port fake;

void fake_reset(void);

/* A rising edge on the trigger input. */
void fake_edge(void);

bool fake_lit(void);

/* Send a body as a line with mark and CRC; returns the body of the reply, without mark, CRC and line feed. */
const char *exchange(struct protocol *protocol, const char *body);

#define CHECK(condition) \
    do { \
        if (!(condition)) { \
            fprintf(stderr, "%s:%d: %s is false\n", __FILE__, __LINE__, #condition); \
            exit(1); \
        } \
    } while (0)

#endif
