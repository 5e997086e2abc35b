/* The whole generator as the protocol sees it: its start, and what it does all the time. */
#ifndef GENERATOR_H
#define GENERATOR_H

#include <stdint.h>

#include "generator_state.h"

/* Safe, or FAULT if the watchdog caused this boot. */
void generator_boot(struct generator *generator, enum cause cause);

/* Watch inputs and host, do what is due; call it at least every few milliseconds. */
void generator_poll(struct generator *generator);

/* Time until generator_poll has something to do, at most POLL_US. While there can be light it looks at the outputs within
 * the millisecond for which an LED may be driven with 25 to 40 A: firmware/README.md, limits. */
enum { POLL_US = 2000, LIVE_POLL_US = 900 };
uint32_t generator_idle_us(const struct generator *generator);

#endif
