/* The control endpoint of a virtual serial port, in the interrupt: USB 2.0, chapter 9, and PSTN 1.2, section 6.3. */
#ifndef USB_CONTROL_H
#define USB_CONTROL_H

#include <stdbool.h>

/* Forget what was under way; after a reset of the bus. */
void usb_control_reset(void);

/* Carry on with what the host has sent or fetched; true when a program there has opened or closed the port. */
bool usb_control_poll(void);

#endif
