/* The laboratory around the host build: the serial line, the interlock switch, the clock, the light.
 * Implements port.h; control.c lets somebody else play with it. */
#ifndef BENCH_H
#define BENCH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "port.h"

struct bench {
    int serial; /* file descriptor of the serial line */
    bool interlock_closed;
    bool interlock_opened; /* since the core last asked */
    bool estop_closed;
    bool estop_opened;
    bool converter_stuck;     /* zero is not confirmed */
    int64_t clock_offset_us;  /* virtual time that has been skipped */
    unsigned replies_to_lose; /* line faults that are still to come */
    unsigned replies_to_damage;
    bool any_stored; /* in memory that outlasts a reset */
    uint32_t stored[STORED_WORDS];
    unsigned stores; /* so often; there is room for as many as on the Pico */
};

extern struct bench bench;

void bench_power_up(void);  /* what a reset does to the hardware */
void bench_find_port(void); /* lets the time pass that a host needs to find a board that has just started */
void bench_set_interlock(bool closed);
void bench_set_estop(bool closed);
void bench_trigger(void); /* a rising edge on the trigger input */
void bench_send(const char *bytes, size_t length);
void bench_print_event(const char *format, ...) __attribute__((format(printf, 1, 2)));

#endif
