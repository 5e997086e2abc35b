/* The controller of the USB device: endpoints, buffers, packets. Between usb.c and usb_control.c, in the interrupt. */
#ifndef USB_CONTROLLER_H
#define USB_CONTROLLER_H

#include <stdbool.h>
#include <stdint.h>

enum usb_direction {
    USB_OUT = 0, /* from the host */
    USB_IN = 1,
};

enum { USB_CONTROL = 0 }; /* the endpoint that every device has */

/* Open or close (0) the pipes; the first packet in each direction is DATA0 again, and what was on its way is lost. */
void usb_configure(uint8_t configuration);
void usb_set_address(uint8_t address);

volatile uint8_t *usb_buffer(uint32_t endpoint, enum usb_direction direction);

/* Give a packet of at most USB_PACKET bytes to the controller, or an empty buffer. */
void usb_transmit(uint32_t endpoint, const uint8_t *bytes, uint32_t count);
void usb_expect(uint32_t endpoint);
uint32_t usb_received_count(uint32_t endpoint);

/* Transfers on the control endpoint start with a DATA1 of their own. */
void usb_restart_control(enum usb_direction direction);
void usb_forget_control(void);
void usb_stall_control(void);

/* Implemented by usb_control.c. */
void usb_control_reset(void);
void usb_control_setup(uint32_t first, uint32_t second);
void usb_control_sent(void);
void usb_control_received(void);

#endif
