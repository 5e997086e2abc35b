/* What the core asks of the machine it runs on. One implementation per machine, and one for the tests.
 *
 * All functions are called from one context, the main loop; none may block longer than a byte takes to send.
 * A port that sees ABORT_BYTE in its receive interrupt switches its outputs off there, forgets the bytes
 * that it has not handed over yet, and then hands over ABORT_BYTE like any other byte. A port that notices that its
 * host has gone does the same with HANG_UP_BYTE. */
#ifndef PORT_H
#define PORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pulse_train.h"

enum { ABORT_BYTE = 0x18, HANG_UP_BYTE = 0x04 };

extern const char port_build[];             /* one word: which port this is */
extern const char port_git[];               /* one word, up to 40 characters: revision of the sources */
extern const uint32_t port_tick_ns;         /* all edges are multiples of it */
extern const uint32_t port_current_step_ma; /* all currents are multiples of it */

/* One word, up to 16 characters: which board this is; no other one answers the same. */
const char *port_serial(void);

/* Monotonic time since boot. */
uint64_t port_now_us(void);

/* False while the input is open, and once after it has been open since the last call, however briefly. */
bool port_interlock_closed(void);
bool port_estop_closed(void);

/* False while the set-points shall be zero and the hardware does not confirm that they are; the port goes on trying. To be
 * asked all the time, also while a reply is sent: each call takes the next step of a look at them, or zeroes them, which
 * takes some ms and happens in the dark. */
bool port_set_points_confirmed(void);

/* Make ready for shots: set-points, read back, and edges. False where this machine cannot produce the train, or a
 * set-point does not read as it was set. */
bool port_load(const struct pulse_train *train);

/* Start one shot of the loaded train and return. It ends by itself with every output at its safe level, and does
 * not repeat. A channel whose current is 0 triggers its camera and gives no light. False if nothing has started,
 * because an interrupt had switched the outputs off before. */
bool port_fire(void);

/* Let the next rising edge of the trigger input start one shot of the loaded train, without the processor. A line that
 * is already high starts nothing. Until the shot has started, and after it, no other edge does anything. */
void port_permit(void);

/* What the trigger input did since the last call, or since port_load. */
struct port_edges {
    uint32_t rises;
    bool fired; /* the permitted shot has started; the one of port_fire does not count here */
};
struct port_edges port_take_edges(void);

/* Camera triggers that were really given since the last call: rises of the outputs. */
uint32_t port_take_cameras(void);

/* Bit i: light output i is high, or was since the last call, whoever drives it. */
uint32_t port_take_lights(void);

/* False where the program, or what was made of the train, does not read as it was written. Looks at a part of it with
 * each call. */
bool port_intact(void);

/* The newest words that were stored, in memory that outlasts a start; false where there never were any, which a memory that
 * does not answer cannot tell. Light is off meanwhile, and while they are stored. */
enum { STORED_WORDS = 16 };
bool port_read_stored(uint32_t words[STORED_WORDS]);

/* Store these behind them. Where they are not, for lack of room or for another reason, the newest are still the old ones, or
 * damaged: the core reads them back. */
void port_store(const uint32_t words[STORED_WORDS]);

/* Bytes since boot that the line has damaged or lost; each spoils the CRC of its request. */
struct port_line_errors {
    uint32_t framing;  /* no stop bit: another rate, or noise */
    uint32_t breaks;   /* low for longer than a byte: a cut wire, a host that resets */
    uint32_t overruns; /* the interrupt came too late */
    uint32_t lost;     /* no room, while a reply was sent */
};
struct port_line_errors port_line_errors(void);

/* False from the moment on that the clocks of this machine did not agree with each other; the outputs are off since. */
bool port_clock_sound(void);

/* Make ready for light for adjustment: set-points, read back; still dark. False as port_load. */
bool port_prepare_light(const uint32_t *current_ma);

/* Light on the prepared channels from now on, for LIGHT_SUSTAIN_MS: without another call it ends by itself. */
void port_sustain_light(void);

/* Every light and trigger output to its safe level, set-points to zero, at once; also in mid-pulse. */
void port_off(void);

/* Send a byte of a reply. */
void port_send(char byte);

#endif
