/* The clocks against each other: the processor's, from the crystal by way of a PLL, counts in an interrupt of its own what
 * the timer, from the crystal alone, has done meanwhile, and the ring oscillator is measured in periods of the crystal. */
#ifndef CLOCK_CHECK_H
#define CLOCK_CHECK_H

#include <stdbool.h>

/* Once, after clocks and timer. */
void clock_check_start(void);

/* False from the first time on that they did not agree; the outputs are off since then. */
bool clock_check_sound(void);

/* For vectors.S. */
void clock_check_isr(void);

#endif
