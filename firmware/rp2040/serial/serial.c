#include "serial.h"

#include <stdint.h>

#include "outputs.h"
#include "rp2040.h"

_Static_assert(SERIAL_RING == UINT8_MAX + 1, "indices wrap by themselves");

static volatile char *ring;
static volatile uint8_t head; /* written by the interrupt */
static volatile uint8_t tail;
volatile struct port_line_errors serial_errors;

void serial_use_ring(volatile char *place)
{
    ring = place;
}

void serial_received(char byte)
{
    if (byte == ABORT_BYTE || byte == HANG_UP_BYTE) {
        outputs_off();
        tail = head;
    }
    if ((uint8_t)(head + 1u) == tail) {
        serial_errors.lost++;
        return;
    }
    ring[head] = byte;
    head = (uint8_t)(head + 1u);
}

bool serial_waiting(void)
{
    return head != tail;
}

bool serial_take(char *byte)
{
    const uint32_t before = interrupts_mask(); /* the interrupt moves the tail too */
    const bool any = serial_waiting();
    if (any) {
        *byte = ring[tail];
        tail = (uint8_t)(tail + 1u);
    }
    interrupts_restore(before);
    return any;
}
