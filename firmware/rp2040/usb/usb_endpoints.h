/* The controller of the USB device: endpoints, buffers, packets. All but the start belongs to its interrupt. */
#ifndef USB_ENDPOINTS_H
#define USB_ENDPOINTS_H

#include <stdbool.h>
#include <stdint.h>

enum { USB_PACKET = 64 };

enum usb_endpoint {
    USB_CONTROL = 0,       /* that every device has */
    USB_NOTIFICATIONS = 1, /* in; required by the class, silent */
    USB_DATA = 2,          /* in and out */
    USB_ENDPOINTS,
};

enum usb_direction {
    USB_OUT = 0, /* from the host */
    USB_IN = 1,
};

void usb_endpoints_start(void);

/* Open or close (0) the pipes; the first packet in each direction is DATA0 again, and what was on its way is lost. */
void usb_endpoints_configure(uint8_t configuration);
void usb_endpoints_set_address(uint8_t address);

volatile uint8_t *usb_endpoints_buffer(uint32_t endpoint, enum usb_direction direction);

/* The rest of the memory of the controller, 3 kB, which it leaves alone: a packet for usb_descriptors.c, and behind it
 * what serial_usb.c needs. */
volatile uint8_t *usb_endpoints_spare(void);

/* Give the host the packet that stands in the buffer, or one that is copied there first; expect one from it. */
void usb_endpoints_give(uint32_t endpoint, uint32_t count);
void usb_endpoints_copy(uint32_t endpoint, const volatile uint8_t *bytes, uint32_t count);
void usb_endpoints_expect(uint32_t endpoint);

/* True once, when the host has fetched or sent a packet. */
bool usb_endpoints_take(uint32_t endpoint, enum usb_direction direction);
uint32_t usb_endpoints_received(uint32_t endpoint); /* bytes of that packet */

/* Are the pipes open, and does no packet wait in this one for the host? */
bool usb_endpoints_can_give(uint32_t endpoint);

/* After a reset of the bus: close the pipes, and have no address. */
void usb_endpoints_reset(void);

/* The control endpoint: its requests, true once for each; its transfers start with a DATA1 of their own. */
bool usb_endpoints_take_setup(uint32_t *first, uint32_t *second);
void usb_endpoints_restart_control(enum usb_direction direction);
void usb_endpoints_forget_control(void);
void usb_endpoints_stall_control(void);

#endif
