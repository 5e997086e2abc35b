/* The virtual serial port: a USB device with one bulk pipe in each direction. Nothing here waits for the host: a reply
 * that it does not fetch is lost, as on a wire. */
#include <stdint.h>

#include "rp2040.h"
#include "serial.h"
#include "usb_control.h"
#include "usb_endpoints.h"

enum { RING = 512 }; /* more than the longest reply */

static volatile uint32_t head;
static volatile uint32_t tail; /* moved by the interrupt alone */

_Static_assert((RING & (RING - 1)) == 0, "indices run on and wrap");

/* In the memory of the USB controller, which has room: bytes on their way to a packet. */
static volatile uint8_t *place(uint32_t index)
{
    return usb_endpoints_spare() + USB_PACKET + index % RING;
}

void serial_start(void)
{
    serial_use_ring((volatile char *)usb_endpoints_spare() + USB_PACKET + RING);
    usb_endpoints_start();
}

/* Packets go when they are full or a line ends. */
void serial_send(char byte)
{
    if (head - tail < RING) {
        *place(head) = (uint8_t)byte;
        head++;
    }
    if (byte == '\n' || head - tail >= USB_PACKET - 1)
        REG(USB_INTF) = USB_INT_BUFFER; /* nothing is masked for it: the interlock comes in between */
}

/* Less than USB_PACKET, so that every packet ends a transfer and none has to be followed by an empty one. */
static uint32_t fill(volatile uint8_t *packet)
{
    uint32_t count = 0;
    for (; tail != head && count < USB_PACKET - 1; tail++)
        packet[count++] = *place(tail);
    return count;
}

static void send_packet(void)
{
    if (!usb_endpoints_can_give(USB_DATA))
        return;
    const uint32_t count = fill(usb_endpoints_buffer(USB_DATA, USB_IN));
    if (count)
        usb_endpoints_give(USB_DATA, count);
}

static void receive_packet(void)
{
    const volatile uint8_t *bytes = usb_endpoints_buffer(USB_DATA, USB_OUT);
    const uint32_t count = usb_endpoints_received(USB_DATA);
    for (uint32_t i = 0; i < count; i++)
        serial_received((char)bytes[i]);
    usb_endpoints_expect(USB_DATA);
}

static void on_bus_reset(void)
{
    usb_endpoints_reset();
    usb_control_reset();
}

/* What it has not fetched is for no other. */
static void on_host_gone(void)
{
    serial_received(HANG_UP_BYTE);
    tail = head;
    REG_CLEAR(USB_SIE_STATUS) = USB_SIE_SUSPENDED;
}

/* Before a request, the data: the abort byte may be in it. */
void serial_usb_isr(void)
{
    REG(USB_INTF) = 0;
    const uint32_t pending = REG(USB_INTS);
    if (pending & (USB_INT_BUS_RESET | USB_INT_SUSPEND))
        on_host_gone();
    if (pending & USB_INT_BUS_RESET)
        on_bus_reset();
    if (usb_endpoints_take(USB_DATA, USB_OUT))
        receive_packet();
    (void)usb_endpoints_take(USB_DATA, USB_IN); /* whose buffer is free again */
    if (usb_control_poll())
        on_host_gone();
    send_packet();
}
