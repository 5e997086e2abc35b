#include "usb_descriptors.h"

#include <stddef.h>

#include "identity.h"
#include "usb_endpoints.h"

enum {
    DEVICE = 1,
    CONFIGURATION = 2,
    STRING = 3,
    INTERFACE = 4,
    ENDPOINT = 5,
    CLASS_INTERFACE = 0x24,
    CLASS_CDC = 2,
    CLASS_CDC_DATA = 10,
    SUBCLASS_ACM = 2,
    BULK = 2,
    INTERRUPT = 3,
    IN = 0x80,
    VENDOR = 0x1209, /* pid.codes; the product number is the one for tests */
    PRODUCT = 0x0001,
    BUS_POWERED = 0x80,
    CURRENT_2_MA = 50,
    SERIAL_NUMBER = 3,
    STRING_SIZE = USB_PACKET - 1,
};

#define TWO_BYTES(number) (number) & 0xff, (number) >> 8

/* Laid out by their parts. */
/* clang-format off */
static const uint8_t DEVICE_DESCRIPTOR[] = {
    18, DEVICE, TWO_BYTES(0x0200), CLASS_CDC, 0, 0, USB_PACKET, TWO_BYTES(VENDOR), TWO_BYTES(PRODUCT),
    TWO_BYTES(0x0100), 1, 2, SERIAL_NUMBER, 1,
};

/* Interface 0: control of the port; interface 1: its data. */
static const uint8_t CONFIGURATION_DESCRIPTOR[] = {
    9, CONFIGURATION, TWO_BYTES(67), 2, 1, 0, BUS_POWERED, CURRENT_2_MA,
    9, INTERFACE, 0, 0, 1, CLASS_CDC, SUBCLASS_ACM, 0, 0,
    5, CLASS_INTERFACE, 0, TWO_BYTES(0x0110), /* header */
    5, CLASS_INTERFACE, 1, 0, 1,              /* calls: none */
    4, CLASS_INTERFACE, 2, 2,                 /* line coding and control line state */
    5, CLASS_INTERFACE, 6, 0, 1,              /* union of both interfaces */
    7, ENDPOINT, IN | USB_NOTIFICATIONS, INTERRUPT, TWO_BYTES(8), 16,
    9, INTERFACE, 1, 0, 2, CLASS_CDC_DATA, 0, 0, 0,
    7, ENDPOINT, USB_DATA, BULK, TWO_BYTES(USB_PACKET), 0,
    7, ENDPOINT, IN | USB_DATA, BULK, TWO_BYTES(USB_PACKET), 0,
};
/* clang-format on */

_Static_assert(sizeof DEVICE_DESCRIPTOR == 18 && sizeof CONFIGURATION_DESCRIPTOR == 67, "as they say of themselves");
_Static_assert(sizeof CONFIGURATION_DESCRIPTOR % USB_PACKET, "its last packet is a short one");

static const uint8_t LANGUAGES[] = {4, STRING, TWO_BYTES(0x0409)};

/* UTF-16; lives until the next one is asked for. */
static struct usb_bytes string(const char *text)
{
    volatile uint8_t *const bytes = usb_endpoints_spare();
    uint32_t count = 2;
    for (; *text && count + 2 <= STRING_SIZE; text++) {
        bytes[count++] = (uint8_t)*text;
        bytes[count++] = 0;
    }
    bytes[0] = (uint8_t)count;
    bytes[1] = STRING;
    return (struct usb_bytes){bytes, count};
}

static struct usb_bytes string_descriptor(uint32_t index)
{
    switch (index) {
    case 0:
        return (struct usb_bytes){LANGUAGES, sizeof LANGUAGES};
    case 1:
        return string("tomoshadow");
    case 2:
        return string("tomoshadow pulse generator");
    case SERIAL_NUMBER:
        return string(identity_serial());
    default:
        return (struct usb_bytes){NULL, 0};
    }
}

struct usb_bytes usb_descriptors_find(uint32_t type, uint32_t index)
{
    if (type == DEVICE)
        return (struct usb_bytes){DEVICE_DESCRIPTOR, sizeof DEVICE_DESCRIPTOR};
    if (type == CONFIGURATION && index == 0)
        return (struct usb_bytes){CONFIGURATION_DESCRIPTOR, sizeof CONFIGURATION_DESCRIPTOR};
    return type == STRING ? string_descriptor(index) : (struct usb_bytes){NULL, 0};
}
