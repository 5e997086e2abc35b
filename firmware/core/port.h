/* What the core asks of the machine it runs on. One implementation per machine, and one for the tests.
 *
 * All functions are called from one context, the main loop; none may block longer than a line takes to send.
 * A port that sees ABORT_BYTE in its receive interrupt switches its outputs off there, forgets the bytes
 * that it has not handed over yet, and then hands over ABORT_BYTE like any other byte. */
#ifndef PORT_H
#define PORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pulse_train.h"

extern const char port_build[];     /* one word: which port this is */
extern const char port_serial[];    /* one word: serial number of the board */
extern const uint32_t port_tick_ns; /* all edges are multiples of it */

/* Monotonic time since boot. */
uint64_t port_now_us(void);

/* False while the interlock is open, and once after it has been open since the last call, however briefly. */
bool port_interlock_closed(void);

/* Make ready for port_fire: set-points and edges. False where this machine cannot produce the train. */
bool port_load(const struct pulse_train *train);

/* Start the loaded train and return. It ends by itself with every output at its safe level, and does not
 * repeat without another port_fire. A channel whose current is 0 triggers its camera and gives no light. */
void port_fire(void);

/* Every light and trigger output to its safe level, set-points to zero, at once; also in mid-pulse. */
void port_off(void);

/* Send the bytes of one reply. */
void port_send(const char *bytes, size_t length);

#endif
