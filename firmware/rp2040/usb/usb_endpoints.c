/* RP2040 data sheet, section 4.1. Every endpoint has one buffer of a packet. */
#include "usb_endpoints.h"

#include "clocks.h"
#include "resets.h"
#include "rp2040.h"

enum { PRIORITY_LOWEST = 3 << 6 };

static bool next_data1[USB_ENDPOINTS][2];
static bool open;
static bool given[USB_ENDPOINTS]; /* a packet waits for the host */

/* The control endpoint has one buffer for both directions, and room for a second one. */
static uint32_t buffer_offset(uint32_t endpoint, enum usb_direction direction)
{
    return endpoint == USB_CONTROL ? 0 : USB_PACKET * (2 * endpoint + direction);
}

volatile uint8_t *usb_endpoints_buffer(uint32_t endpoint, enum usb_direction direction)
{
    return (volatile uint8_t *)(uintptr_t)(USB_BUFFERS + buffer_offset(endpoint, direction));
}

volatile uint8_t *usb_endpoints_spare(void)
{
    return (volatile uint8_t *)(uintptr_t)(USB_BUFFERS + USB_PACKET * 2 * USB_ENDPOINTS);
}

/* The buffer goes to the controller by a write of its own, when the rest has arrived in the clock of the USB: section
 * 4.1.2.5.1. */
static void hand_over(uint32_t endpoint, enum usb_direction direction, uint32_t control)
{
    control |= next_data1[endpoint][direction] ? USB_BUFFER_DATA1 : 0u;
    next_data1[endpoint][direction] = !next_data1[endpoint][direction];
    REG(USB_BUFFER_CONTROL(endpoint, direction)) = control;
    for (int i = 0; i < CLOCK_MHZ / 48 + 1; i++)
        __asm__ volatile("nop\n\tnop\n\tnop");
    REG(USB_BUFFER_CONTROL(endpoint, direction)) = control | USB_BUFFER_AVAILABLE;
}

void usb_endpoints_give(uint32_t endpoint, uint32_t count)
{
    given[endpoint] = true;
    hand_over(endpoint, USB_IN, USB_BUFFER_FULL | count);
}

void usb_endpoints_copy(uint32_t endpoint, const volatile uint8_t *bytes, uint32_t count)
{
    volatile uint8_t *to = usb_endpoints_buffer(endpoint, USB_IN);
    for (uint32_t i = 0; i < count; i++)
        to[i] = bytes[i];
    usb_endpoints_give(endpoint, count);
}

void usb_endpoints_expect(uint32_t endpoint)
{
    hand_over(endpoint, USB_OUT, USB_PACKET);
}

bool usb_endpoints_take(uint32_t endpoint, enum usb_direction direction)
{
    const uint32_t bit = 1u << (2 * endpoint + (direction == USB_OUT));
    if (!(REG(USB_BUFF_STATUS) & bit))
        return false;
    REG_CLEAR(USB_BUFF_STATUS) = bit;
    if (direction == USB_IN)
        given[endpoint] = false;
    return true;
}

uint32_t usb_endpoints_received(uint32_t endpoint)
{
    return REG(USB_BUFFER_CONTROL(endpoint, USB_OUT)) & USB_BUFFER_LENGTH;
}

bool usb_endpoints_can_give(uint32_t endpoint)
{
    return open && !given[endpoint];
}

static void open_endpoint(uint32_t endpoint, enum usb_direction direction, uint32_t type)
{
    next_data1[endpoint][direction] = false;
    const uint32_t address = (USB_BUFFERS & 0xfffu) + buffer_offset(endpoint, direction);
    REG(USB_BUFFER_CONTROL(endpoint, direction)) = 0;
    REG(USB_ENDPOINT_CONTROL(endpoint, direction)) = USB_ENDPOINT_ENABLE | USB_ENDPOINT_INTERRUPT | type | address;
}

static void close_endpoints(void)
{
    for (uint32_t endpoint = 1; endpoint < USB_ENDPOINTS; endpoint++) {
        for (uint32_t direction = USB_OUT; direction <= USB_IN; direction++) {
            REG(USB_ENDPOINT_CONTROL(endpoint, direction)) = 0;
            REG(USB_BUFFER_CONTROL(endpoint, direction)) = 0;
        }
        given[endpoint] = false;
    }
}

void usb_endpoints_configure(uint8_t configuration)
{
    close_endpoints();
    open = configuration != 0;
    if (!open)
        return;
    open_endpoint(USB_NOTIFICATIONS, USB_IN, USB_ENDPOINT_OF_INTERRUPTS);
    open_endpoint(USB_DATA, USB_IN, USB_ENDPOINT_BULK);
    open_endpoint(USB_DATA, USB_OUT, USB_ENDPOINT_BULK);
    usb_endpoints_expect(USB_DATA);
}

void usb_endpoints_set_address(uint8_t address)
{
    REG(USB_ADDR_ENDP) = address;
}

void usb_endpoints_reset(void)
{
    REG_CLEAR(USB_SIE_STATUS) = USB_SIE_BUS_RESET;
    usb_endpoints_set_address(0);
    usb_endpoints_configure(0);
}

bool usb_endpoints_take_setup(uint32_t *first, uint32_t *second)
{
    if (!(REG(USB_INTS) & USB_INT_SETUP))
        return false;
    REG_CLEAR(USB_SIE_STATUS) = USB_SIE_SETUP;
    *first = REG(USB_SETUP_PACKET);
    *second = REG(USB_SETUP_PACKET + 4);
    return true;
}

void usb_endpoints_restart_control(enum usb_direction direction)
{
    next_data1[USB_CONTROL][direction] = true;
}

void usb_endpoints_forget_control(void)
{
    REG(USB_BUFFER_CONTROL(USB_CONTROL, USB_IN)) = 0;
    REG(USB_BUFFER_CONTROL(USB_CONTROL, USB_OUT)) = 0;
}

void usb_endpoints_stall_control(void)
{
    REG(USB_EP_STALL_ARM) = USB_STALL_CONTROL;
    REG(USB_BUFFER_CONTROL(USB_CONTROL, USB_IN)) = USB_BUFFER_STALL;
    REG(USB_BUFFER_CONTROL(USB_CONTROL, USB_OUT)) = USB_BUFFER_STALL;
}

ONCE void usb_endpoints_start(void)
{
    clocks_start_usb();
    resets_restart(RESET_USB);
    for (uint32_t address = USB_SETUP_PACKET; address < USB_BUFFERS; address += 4)
        REG(address) = 0;
    REG(USB_MUXING) = USB_TO_PHY | USB_SOFTCON;
    REG(USB_PWR) = USB_VBUS_DETECT | USB_VBUS_OVERRIDE; /* powered from there, or not: section 4.1.2.9 */
    REG(USB_MAIN_CTRL) = USB_CONTROLLER_ENABLE;
    REG(USB_INTE) = USB_INT_BUFFER | USB_INT_BUS_RESET | USB_INT_SUSPEND | USB_INT_SETUP;
    REG(NVIC_PRIORITY(INTERRUPT_USB)) |= PRIORITY_LOWEST << 8 * (INTERRUPT_USB % 4);
    REG(NVIC_ENABLE) = 1u << INTERRUPT_USB;
    REG(USB_SIE_CTRL) = USB_SIE_INTERRUPT_PER_BUFFER | USB_SIE_PULL_UP;
}
