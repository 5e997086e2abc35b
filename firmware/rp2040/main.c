/* The port of the core to the RP2040, and its main loop. */
#include "clocks.h"
#include "interlock.h"
#include "outputs.h"
#include "pins.h"
#include "port.h"
#include "protocol.h"
#include "rp2040.h"
#include "serial.h"
#include "set_points.h"
#include "vectors.h"
#include "watchdog.h"

const char port_build[] = "rp2040";
const char port_serial[] = "unset";
const uint32_t port_tick_ns = TICK_NS;

enum {
    POLL_US = 2000, /* the core wants to be polled every few milliseconds */
    ALARM0 = 1,
    PRIORITY_LOWEST = 3 << 6,
};

static struct protocol protocol;

uint64_t port_now_us(void)
{
    uint32_t high = 0;
    uint32_t low = 0;
    do {
        high = REG(TIMER_RAWH);
        low = REG(TIMER_RAWL);
    } while (high != REG(TIMER_RAWH));
    return (uint64_t)high << 32 | low;
}

bool port_interlock_closed(void)
{
    return interlock_take_closed();
}

bool port_load(const struct pulse_train *train)
{
    return outputs_load(train);
}

void port_fire(void)
{
    outputs_fire();
}

void port_off(void)
{
    outputs_off();
}

void port_send(const char *bytes, size_t length)
{
    serial_send(bytes, length);
}

void isr_timer0(void)
{
    REG(TIMER_INTR) = ALARM0;
}

/* The interlock before all others. */
static void start_interrupts(void)
{
    REG(NVIC_PRIORITY(INTERRUPT_TIMER0)) = PRIORITY_LOWEST << 8 * (INTERRUPT_TIMER0 % 4);
    REG(NVIC_PRIORITY(INTERRUPT_UART0)) = PRIORITY_LOWEST << 8 * (INTERRUPT_UART0 % 4);
    REG(TIMER_INTE) = ALARM0;
    REG(NVIC_ENABLE) = 1u << INTERRUPT_TIMER0 | 1u << INTERRUPT_IO_BANK0 | 1u << INTERRUPT_UART0;
    __asm__ volatile("cpsie i" ::: "memory");
}

/* Until a byte, the interlock or the next poll. Masked, so that none of them slips in between look and sleep; the
 * alarm is set afresh each time, because one that lies in the past would never come. */
static void sleep(void)
{
    const uint32_t before = interrupts_mask();
    if (!serial_waiting()) {
        REG(TIMER_ALARM0) = REG(TIMER_RAWL) + POLL_US;
        __asm__ volatile("wfi" ::: "memory");
    }
    interrupts_restore(before);
}

int main(void)
{
    char byte = 0;
    outputs_start();
    clocks_start();
    blocks_restart(RESET_TIMER);
    const struct start start = watchdog_read_start();
    watchdog_start();
    set_points_start();
    interlock_start();
    serial_start();
    protocol_boot(&protocol, start.boot, start.by_watchdog);
    start_interrupts();
    for (;;) {
        watchdog_feed();
        while (serial_take(&byte))
            protocol_receive(&protocol, byte);
        protocol_poll(&protocol);
        (void)set_points_confirmed();
        sleep();
    }
}
