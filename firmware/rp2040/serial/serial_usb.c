/* The virtual serial port. Nothing here waits for the host: a reply that it does not fetch is lost, as on a wire. */
#include <stdbool.h>
#include <stdint.h>

#include "serial.h"
#include "usb.h"

enum { RING = 512 }; /* more than the longest reply */

static volatile uint8_t ring[RING];
static volatile uint32_t head;
static volatile uint32_t tail; /* moved by the interrupt alone */

_Static_assert((RING & (RING - 1)) == 0, "indices run on and wrap");

void serial_start(void)
{
    usb_start();
}

/* Bytes come one by one; packets go when they are full or a line ends. */
void serial_send(const char *bytes, size_t length)
{
    bool complete = false;
    for (size_t i = 0; i < length && head - tail < RING; i++) {
        ring[head % RING] = (uint8_t)bytes[i];
        head++;
        complete = complete || bytes[i] == '\n' || head - tail >= USB_PACKET - 1;
    }
    if (complete)
        usb_notify();
}

uint32_t usb_fill(volatile uint8_t *packet)
{
    uint32_t count = 0;
    for (; tail != head && count < USB_PACKET - 1; tail++)
        packet[count++] = ring[tail % RING];
    return count;
}

/* What nobody has fetched was meant for the program before. */
void usb_opened(void)
{
    tail = head;
}

void usb_received(const volatile uint8_t *bytes, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        serial_received((char)bytes[i]);
}
