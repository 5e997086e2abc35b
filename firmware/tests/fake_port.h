/* A port for the tests: everything the core asks of it can be set or read here. */
#ifndef FAKE_PORT_H
#define FAKE_PORT_H

#include <stdio.h>
#include <stdlib.h>

#include "port.h"
#include "protocol.h"

enum { FIRING_US = 3 }; /* time that port_fire takes; the light may start at its end */

struct fake_port {
    uint64_t now_us;
    bool interlock_closed;
    bool can_load;
    struct pulse_train loaded;
    bool live; /* between port_load and port_off */
    unsigned fired;
    unsigned replies;
    char reply[TEXT_SIZE]; /* newest, terminated by zero */
};

extern struct fake_port fake;

void fake_reset(void);

/* Send a body as a line with its CRC; returns the body of the reply, without CRC and line feed. */
const char *exchange(struct protocol *protocol, const char *body);

#define CHECK(condition)                                                               \
    do {                                                                               \
        if (!(condition)) {                                                            \
            fprintf(stderr, "%s:%d: %s is false\n", __FILE__, __LINE__, #condition);   \
            exit(1);                                                                   \
        }                                                                              \
    } while (0)

#endif
