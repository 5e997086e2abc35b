/* The line to the host. Two implementations of start and send: serial_uart.c, and serial_usb.c, a virtual serial port.
 * The abort byte acts in the receive interrupt of either, and so does a host that goes away from USB. */
#ifndef SERIAL_H
#define SERIAL_H

#include <stdbool.h>

#include "port.h"

void serial_start(void);
bool serial_waiting(void); /* is there a byte? */
bool serial_take(char *byte);
void serial_send(char byte);

/* For vectors.S; an image has one of them. */
void serial_uart_isr(void);
void serial_usb_isr(void);

/* For serial_start: where received bytes wait for the main loop, room for two of the longest lines. */
enum { SERIAL_RING = 256 };
void serial_use_ring(volatile char *place);

/* From the receive interrupt. A byte that finds no room is lost, and counted; the CRC of its line tells too. */
void serial_received(char byte);

/* What the line has done to bytes since boot; the UART counts its part in its interrupt. */
extern volatile struct port_line_errors serial_errors;

#endif
