#include "watchdog.h"

#include <stdbool.h>

#include "rp2040.h"

enum {
    REASON_TIMER = 1,
    REASON_FORCE = 2,
    HAD_POWER = 1 << 8, /* switched on, or a brown-out */
    HAD_RUN_PIN = 1 << 16,
    HAD_DEBUGGER = 1 << 20,
    ENABLE = 1 << 30,
    TICKS = WATCHDOG_MS * 1000 * 2, /* it counts twice per microsecond: erratum RP2040-E1 */
    /* All but the two oscillators, section 2.13.5. The reset controller among them holds PIO, pins and pads. */
    DOMAINS = 0x1fffc,
    SCRATCH_MARK = 0, /* scratch registers survive the watchdog and nothing else; the boot ROM uses those from 4 on */
    SCRATCH_BOOT = 1,
    MARK = 0x746f6d6f,
    RANDOM_BITS = 16,
};

_Static_assert(TICKS < 1 << 24, "the counter has 24 bits");

/* From the jitter of the ring oscillator, section 2.17.5: a host that slept through a power cut sees the change. */
ONCE static uint32_t random_number(void)
{
    uint32_t number = 0;
    for (int i = 0; i < RANDOM_BITS; i++)
        number = number << 1 | (REG(ROSC_RANDOMBIT) & 1u);
    return number;
}

/* The watchdog leaves the register of the chip as it was. Its own registers survive its resets, and no others. The boot
 * loader ends with a watchdog reset too, but leaves no mark. */
ONCE static enum cause read_cause(bool marked)
{
    const uint32_t reason = REG(WATCHDOG_REASON);
    const uint32_t chip = REG(CHIP_RESET);
    if (reason & REASON_TIMER && marked)
        return CAUSE_WATCHDOG;
    if (reason & (REASON_TIMER | REASON_FORCE))
        return CAUSE_SOFTWARE;
    if (chip & HAD_DEBUGGER)
        return CAUSE_DEBUG;
    if (chip & HAD_RUN_PIN)
        return CAUSE_PIN;
    return chip & HAD_POWER ? CAUSE_POWER : CAUSE_UNKNOWN;
}

ONCE struct start watchdog_read_start(void)
{
    const bool marked = REG(WATCHDOG_SCRATCH(SCRATCH_MARK)) == MARK;
    const struct start start = {
        .boot = marked ? REG(WATCHDOG_SCRATCH(SCRATCH_BOOT)) + 1u : 1u + random_number(),
        .cause = read_cause(marked),
    };
    REG(WATCHDOG_SCRATCH(SCRATCH_BOOT)) = start.boot;
    REG(WATCHDOG_SCRATCH(SCRATCH_MARK)) = MARK;
    return start;
}

ONCE void watchdog_start(void)
{
    REG(PSM_WDSEL) = DOMAINS; /* 0 after power-up: the watchdog would then reset nothing */
    watchdog_feed();
    REG(WATCHDOG_CTRL) = ENABLE;
}

void watchdog_feed(void)
{
    REG(WATCHDOG_LOAD) = TICKS;
}
