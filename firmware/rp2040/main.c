/* The main loop. */
#include "clock_check.h"
#include "clocks.h"
#include "flash.h"
#include "generator.h"
#include "identity.h"
#include "image_check.h"
#include "interlock.h"
#include "outputs.h"
#include "protocol.h"
#include "rp2040.h"
#include "serial.h"
#include "set_points.h"
#include "state_machines.h"
#include "supply.h"
#include "timer.h"
#include "watchdog.h"

enum {
    SLEEP_AT_LEAST_US = 5, /* an alarm that is set too late never comes */
    PRIORITY_LOWEST = 3 << 6,
};

static struct protocol protocol;

/* The interlock before all others. */
static void start_interrupts(void)
{
    REG(SCB_SHPR3) = (uint32_t)PRIORITY_LOWEST << 24;
    REG(NVIC_PRIORITY(INTERRUPT_TIMER0)) = PRIORITY_LOWEST << 8 * (INTERRUPT_TIMER0 % 4);
    REG(NVIC_PRIORITY(INTERRUPT_UART0)) = PRIORITY_LOWEST << 8 * (INTERRUPT_UART0 % 4);
    REG(NVIC_ENABLE) = 1u << INTERRUPT_TIMER0 | 1u << INTERRUPT_IO_BANK0 | 1u << INTERRUPT_UART0;
    __asm__ volatile("cpsie i" ::: "memory");
}

/* Until a byte, an edge, or something is due. Masked, so that none of them slips in between look and sleep; the
 * alarm is set afresh each time, because one that lies in the past would never come. */
static void sleep(uint32_t time_us)
{
    const uint32_t before = interrupts_mask();
    if (!serial_waiting() && time_us >= SLEEP_AT_LEAST_US) {
        timer_set_alarm(time_us);
        __asm__ volatile("wfi" ::: "memory");
    }
    interrupts_restore(before);
}

/* From flash, as a whole: so few calls lead from RAM to there. */
ONCE static struct start start_chip(void)
{
    outputs_start();
    supply_start();
    clocks_start();
    timer_start();
    clock_check_start();
    const struct start start = watchdog_read_start();
    watchdog_start();
    set_points_start();
    interlock_start();
    serial_start();
    return start;
}

int main(void)
{
    char byte = 0;
    const struct start start = start_chip();
    flash_take_over(); /* nothing runs from there after it */
    identity_read_board();
    protocol_boot(&protocol, start.boot, start.cause);
    start_interrupts();
    for (;;) {
        watchdog_feed();
        if (serial_take(&byte)) /* one in a turn: what comes as fast as it is taken must not keep all else waiting */
            protocol_receive(&protocol, byte);
        state_machines_poll();
        image_check_poll();
        protocol_poll(&protocol);
        sleep(generator_idle_us(&protocol.generator));
    }
}
