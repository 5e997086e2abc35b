/* The line to the host: UART0, 115200 baud, 8N1. The abort byte acts in the receive interrupt. */
#ifndef SERIAL_H
#define SERIAL_H

#include <stdbool.h>
#include <stddef.h>

void serial_start(void);
bool serial_waiting(void); /* is there a byte? */
bool serial_take(char *byte);
void serial_send(const char *bytes, size_t length);

#endif
