#include "usb_control.h"

#include <stddef.h>

#include "usb_descriptors.h"
#include "usb_endpoints.h"

enum { LINE_CODING_SIZE = 7 };

/* bmRequestType << 8 | bRequest; requests to interfaces do not need their number, both interfaces are one port. */
enum request {
    GET_DESCRIPTOR = 0x8006,
    GET_STATUS_DEVICE = 0x8000,
    GET_STATUS_INTERFACE = 0x8100,
    GET_STATUS_ENDPOINT = 0x8200,
    GET_CONFIGURATION = 0x8008,
    GET_LINE_CODING = 0xa121,
    SET_ADDRESS = 0x0005,
    SET_CONFIGURATION = 0x0009,
    CLEAR_HALT = 0x0201,
    SET_LINE_CODING = 0x2120,
    SET_CONTROL_LINES = 0x2122,
};

/* Of a control transfer. */
enum stage {
    STAGE_IDLE,
    STAGE_DATA_IN,
    STAGE_DATA_OUT,
    STAGE_STATUS,
};

struct setup {
    uint32_t request;
    uint32_t value;
    uint32_t index;
    uint32_t length;
};

static enum stage stage;
static struct usb_bytes left; /* to be sent in STAGE_DATA_IN */
static uint8_t configuration;
static uint8_t new_address;
static uint8_t line_coding[LINE_CODING_SIZE]; /* as the host has set it; means nothing */

static void refuse(void)
{
    stage = STAGE_IDLE;
    usb_endpoints_stall_control();
}

static void acknowledge(void)
{
    stage = STAGE_STATUS;
    usb_endpoints_restart_control(USB_IN);
    usb_endpoints_give(USB_CONTROL, 0);
}

static void send_left(void)
{
    const uint32_t count = left.count < USB_PACKET ? left.count : USB_PACKET;
    usb_endpoints_copy(USB_CONTROL, left.bytes, count);
    left.bytes += count;
    left.count -= count;
}

/* As much of it as the host has asked for. */
static void answer(struct usb_bytes bytes, uint32_t length)
{
    stage = STAGE_DATA_IN;
    left = bytes;
    left.count = bytes.count < length ? bytes.count : length;
    send_left();
}

static void take_line_coding(void)
{
    const volatile uint8_t *from = usb_endpoints_buffer(USB_CONTROL, USB_OUT);
    for (uint32_t i = 0; i < sizeof line_coding; i++)
        line_coding[i] = from[i];
    acknowledge();
}

static struct setup parsed(uint32_t first, uint32_t second)
{
    return (struct setup){
        .request = (first & 0xffu) << 8 | (first >> 8 & 0xffu),
        .value = first >> 16,
        .index = second & 0xffffu,
        .length = second >> 16,
    };
}

static void answer_question(const struct setup *setup)
{
    static const uint8_t STATUS[2];
    const struct usb_bytes descriptor = usb_descriptors_find(setup->value >> 8, setup->value & 0xffu);
    switch (setup->request) {
    case GET_DESCRIPTOR:
        if (descriptor.bytes)
            answer(descriptor, setup->length);
        else
            refuse();
        break;
    case GET_STATUS_DEVICE:
    case GET_STATUS_INTERFACE:
    case GET_STATUS_ENDPOINT:
        answer((struct usb_bytes){STATUS, sizeof STATUS}, setup->length);
        break;
    case GET_CONFIGURATION:
        answer((struct usb_bytes){&configuration, sizeof configuration}, setup->length);
        break;
    case GET_LINE_CODING:
        answer((struct usb_bytes){line_coding, sizeof line_coding}, setup->length);
        break;
    default:
        refuse();
    }
}

static void carry_out(const struct setup *setup)
{
    switch (setup->request) {
    case SET_ADDRESS:
        new_address = (uint8_t)(setup->value & 0x7fu); /* counts from the end of this transfer on */
        acknowledge();
        break;
    case SET_CONFIGURATION:
        if (setup->value > 1) {
            refuse();
            break;
        }
        configuration = (uint8_t)setup->value;
        usb_endpoints_configure(configuration);
        acknowledge();
        break;
    case CLEAR_HALT:
        usb_endpoints_configure(configuration);
        acknowledge();
        break;
    case SET_CONTROL_LINES:
        acknowledge();
        break;
    case SET_LINE_CODING:
        if (setup->length != LINE_CODING_SIZE) {
            refuse();
            break;
        }
        stage = STAGE_DATA_OUT;
        usb_endpoints_restart_control(USB_OUT);
        usb_endpoints_expect(USB_CONTROL);
        break;
    default:
        refuse();
    }
}

/* Whether a program on the host has opened or closed the port. */
static bool on_setup(uint32_t first, uint32_t second)
{
    const struct setup setup = parsed(first, second);
    usb_endpoints_forget_control(); /* whatever was before, the host has given it up */
    usb_endpoints_restart_control(USB_IN);
    new_address = 0;
    if (setup.request & 0x8000u)
        answer_question(&setup);
    else
        carry_out(&setup);
    return setup.request == SET_CONTROL_LINES;
}

static void on_sent(void)
{
    if (stage == STAGE_DATA_IN && left.count) {
        send_left();
    } else if (stage == STAGE_DATA_IN) {
        stage = STAGE_STATUS;
        usb_endpoints_restart_control(USB_OUT);
        usb_endpoints_expect(USB_CONTROL);
    } else if (new_address) {
        usb_endpoints_set_address(new_address);
        new_address = 0;
    }
}

static void on_received(void)
{
    if (stage == STAGE_DATA_OUT && usb_endpoints_received(USB_CONTROL) == LINE_CODING_SIZE)
        take_line_coding();
}

/* Packets before a new request: they belong to the transfer before it. */
bool usb_control_poll(void)
{
    uint32_t first = 0;
    uint32_t second = 0;
    if (usb_endpoints_take(USB_CONTROL, USB_OUT))
        on_received();
    if (usb_endpoints_take(USB_CONTROL, USB_IN))
        on_sent();
    return usb_endpoints_take_setup(&first, &second) && on_setup(first, second);
}

void usb_control_reset(void)
{
    stage = STAGE_IDLE;
    configuration = 0;
    new_address = 0;
}
