/* What the device says of itself: USB 2.0, chapter 9; CDC 1.2; PSTN 1.2. */
#ifndef USB_DESCRIPTORS_H
#define USB_DESCRIPTORS_H

#include <stdint.h>

struct usb_bytes {
    const volatile uint8_t *bytes; /* NULL: there is none */
    uint32_t count;
};

struct usb_bytes usb_descriptors_find(uint32_t type, uint32_t index);

#endif
