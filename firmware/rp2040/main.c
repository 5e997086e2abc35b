/* The port of the core to the RP2040, and its main loop. */
#include "clocks.h"
#include "continuous_light.h"
#include "generator.h"
#include "identity.h"
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

enum {
    SLEEP_AT_LEAST_US = 5, /* an alarm that is set too late never comes */
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
    (void)interlock_take_edges(); /* they are of no concern to this train */
    return outputs_load(train);
}

bool port_estop_closed(void)
{
    return interlock_take_estop_closed();
}

bool port_set_points_confirmed(void)
{
    return set_points_confirmed();
}

bool port_fire(void)
{
    return outputs_fire();
}

void port_permit(void)
{
    outputs_permit();
}

struct port_edges port_take_edges(void)
{
    return interlock_take_edges();
}

uint32_t port_take_cameras(void)
{
    return outputs_take_cameras();
}

bool port_prepare_light(const uint32_t *current_ma)
{
    return continuous_light_prepare(current_ma);
}

void port_sustain_light(void)
{
    continuous_light_sustain();
}

void port_off(void)
{
    outputs_off();
}

void port_send(const char *bytes, size_t length)
{
    for (size_t i = 0; i < length; i++) { /* triggers and light do not wait for a reply */
        serial_send(bytes + i, 1);
        protocol_poll(&protocol);
    }
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

/* Until a byte, an edge, or something is due. Masked, so that none of them slips in between look and sleep; the
 * alarm is set afresh each time, because one that lies in the past would never come. */
static void sleep(uint32_t time_us)
{
    const uint32_t before = interrupts_mask();
    if (!serial_waiting() && time_us >= SLEEP_AT_LEAST_US) {
        REG(TIMER_ALARM0) = REG(TIMER_RAWL) + time_us;
        __asm__ volatile("wfi" ::: "memory");
    }
    interrupts_restore(before);
}

int main(void)
{
    char byte = 0;
    outputs_start();
    clocks_start();
    identity_read_board();
    blocks_restart(RESET_TIMER);
    const struct start start = watchdog_read_start();
    watchdog_start();
    set_points_start();
    interlock_start();
    serial_start();
    protocol_boot(&protocol, start.boot, start.cause);
    start_interrupts();
    for (;;) {
        watchdog_feed();
        while (serial_take(&byte))
            protocol_receive(&protocol, byte);
        set_points_poll();
        protocol_poll(&protocol);
        sleep(generator_idle_us(&protocol.generator));
    }
}
