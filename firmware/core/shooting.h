/* Shots: permission for a number of them, and the three sources that start them. Every path to port_fire and to
 * port_permit leads through the same permission.
 *
 *     COMMAND   shooting_fire starts a shot.
 *     TIMER     A shot every period, the first one a period after arming. A late one shifts those after it; what was
 *               missed is not caught up with.
 *     EXTERNAL  The trigger input starts a shot by itself, without the processor, once for each permission. The next
 *               permission is given when the period of the shot before is over: an edge that comes earlier finds
 *               nothing to start. It is counted and forgotten. */
#ifndef SHOOTING_H
#define SHOOTING_H

#include "generator_state.h"

/* The period: of the timer, and for the other sources a promise of the host, or 0. A period that the train does not
 * permit is refused here rather than shot by shot. */
enum error shooting_arm(struct generator *generator, uint32_t shots, uint32_t source, uint32_t period_us);
enum error shooting_fire(struct generator *generator);

/* Do what is due; for generator_poll. */
void shooting_poll(struct generator *generator);
uint64_t shooting_due_us(const struct generator *generator);

#endif
