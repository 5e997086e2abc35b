/* UART0, 115200 baud, 8N1. */
#include <stdint.h>

#include "clocks.h"
#include "pins.h"
#include "resets.h"
#include "rp2040.h"
#include "serial.h"

enum {
    BAUD = 115200,
    DIVIDER_64 = (CLOCK_MHZ * 1000000 * 4 + BAUD / 2) / BAUD, /* clock / (16 x baud), in 1/64 */
};

static volatile char ring[SERIAL_RING];

ONCE void serial_start(void)
{
    serial_use_ring(ring);
    resets_restart(RESET_UART0);
    REG(UART0_IBRD) = DIVIDER_64 / 64;
    REG(UART0_FBRD) = DIVIDER_64 % 64;
    REG(UART0_LCR_H) = UART_LCR_8_BITS; /* no FIFO: the abort byte interrupts when it arrives, not 32 bits later */
    REG(UART0_CR) = UART_CR_ENABLE;
    REG(UART0_IMSC) = UART_INT_RX;
    REG(PAD(PIN_UART_RX)) = PAD_INPUT | PAD_PULL_UP | PAD_SCHMITT; /* an open line is silent */
    REG(IO_CTRL(PIN_UART_TX)) = FUNCTION_UART;
    REG(IO_CTRL(PIN_UART_RX)) = FUNCTION_UART;
}

/* A break ends without a stop bit too. A line of 8N1 has no parity. What was received goes on to the core, whose CRC
 * refuses it; an abort byte counts however it arrives. */
static void count_errors(uint32_t received)
{
    if (received & UART_DR_BREAK)
        serial_errors.breaks++;
    else if (received & UART_DR_FRAMING)
        serial_errors.framing++;
    if (received & UART_DR_OVERRUN)
        serial_errors.overruns++;
}

void serial_uart_isr(void)
{
    while (!(REG(UART0_FR) & UART_FR_RX_EMPTY)) {
        const uint32_t received = REG(UART0_DR);
        count_errors(received);
        serial_received((char)(received & 0xffu));
    }
}

void serial_send(char byte)
{
    while (REG(UART0_FR) & UART_FR_TX_FULL)
        ;
    REG(UART0_DR) = (uint8_t)byte;
}
