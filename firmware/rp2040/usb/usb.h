/* A USB device of one kind: a virtual serial port (CDC ACM, full speed) with one bulk pipe in each direction.
 * Everything happens in its interrupt. */
#ifndef USB_H
#define USB_H

#include <stdint.h>

enum { USB_PACKET = 64 };

void usb_start(void);
void usb_isr(void);

/* There is something to send: usb_fill will be called as soon as the pipe is open and free. */
void usb_notify(void);

/* From the interrupt, implemented by serial_usb.c. */
void usb_opened(void);                                            /* a program on the host has opened the port */
void usb_received(const volatile uint8_t *bytes, uint32_t count); /* valid during the call */

/* Write the next packet; returns its bytes, 0 for nothing to send. Less than USB_PACKET, so that every packet ends a
 * transfer and none has to be followed by an empty one. */
uint32_t usb_fill(volatile uint8_t *packet);

#endif
