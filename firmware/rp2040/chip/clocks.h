/* The clock tree: 12 MHz crystal, PLL, 125 MHz for everything, and a timer of 1 us. */
#ifndef CLOCKS_H
#define CLOCKS_H

enum { CLOCK_MHZ = 125, TICK_NS = 1000 / CLOCK_MHZ };

void clocks_start(void);
void clocks_start_usb(void); /* 48 MHz for the USB, after it */

#endif
