#include "serial.h"

#include <stdint.h>

#include "clocks.h"
#include "outputs.h"
#include "pins.h"
#include "protocol.h"
#include "rp2040.h"
#include "vectors.h"

enum {
    BAUD = 115200,
    DIVIDER_64 = (CLOCK_MHZ * 1000000 * 4 + BAUD / 2) / BAUD, /* clock / (16 x baud), in 1/64 */
    RING = 256,                                              /* two of the longest lines */
};

_Static_assert(RING == UINT8_MAX + 1, "indices wrap by themselves");

static volatile char ring[RING];
static volatile uint8_t head; /* written by the interrupt */
static volatile uint8_t tail;

void serial_start(void)
{
    blocks_restart(RESET_UART0);
    REG(UART0_IBRD) = DIVIDER_64 / 64;
    REG(UART0_FBRD) = DIVIDER_64 % 64;
    REG(UART0_LCR_H) = UART_LCR_8_BITS; /* no FIFO: the abort byte interrupts when it arrives, not 32 bits later */
    REG(UART0_CR) = UART_CR_ENABLE;
    REG(UART0_IMSC) = UART_INT_RX;
    REG(PAD(PIN_UART_RX)) = PAD_INPUT | PAD_PULL_UP | PAD_SCHMITT; /* an open line is silent */
    REG(IO_CTRL(PIN_UART_TX)) = FUNCTION_UART;
    REG(IO_CTRL(PIN_UART_RX)) = FUNCTION_UART;
}

/* A byte that finds the ring full is lost; the CRC of its line tells. */
static void store(char byte)
{
    if (byte == ABORT_BYTE) {
        outputs_off();
        tail = head;
    }
    if ((uint8_t)(head + 1u) != tail) {
        ring[head] = byte;
        head = (uint8_t)(head + 1u);
    }
}

void isr_uart0(void)
{
    while (!(REG(UART0_FR) & UART_FR_RX_EMPTY))
        store((char)(REG(UART0_DR) & 0xffu));
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

void serial_send(const char *bytes, size_t length)
{
    for (size_t i = 0; i < length; i++) {
        while (REG(UART0_FR) & UART_FR_TX_FULL)
            ;
        REG(UART0_DR) = (uint8_t)bytes[i];
    }
}
