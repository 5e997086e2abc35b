/* The clock tree: 12 MHz crystal, PLL, 125 MHz for everything, and a timer of 1 us. */
#ifndef CLOCKS_H
#define CLOCKS_H

#include <stdint.h>

enum { CLOCK_MHZ = 125, TICK_NS = 1000 / CLOCK_MHZ };

void clocks_start(void);
void clocks_start_usb(void); /* 48 MHz for the USB, after it */

/* Put these blocks into reset and take them out again: whatever they did before, they now do nothing. */
void blocks_restart(uint32_t reset_bits);

#endif
