/* Continuous light of low current, for adjusting cameras and for the calibration target. Made of short pulses with
 * dark between them: docs/decisions tells why. */
#ifndef LIGHT_H
#define LIGHT_H

#include "generator_state.h"

/* Light on the channels whose current is not 0, for this time at most. Only while SAFE, with the set-points of pulses
 * long gone. */
enum error light_start(struct generator *generator, uint32_t time_ms, const uint32_t *requested_ma);

/* Keep it on, or end it; for generator_poll. */
void light_poll(struct generator *generator);

#endif
