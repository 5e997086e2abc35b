#include "clock_check.h"

#include "clocks.h"
#include "outputs.h"
#include "rp2040.h"

enum {
    EVERY_US = 10000,
    TOLERANCE = 4, /* a quarter: of the time, and of what the ring oscillator was at the start; it drifts */
    CRYSTAL_KHZ = 12000,
    INTERVAL_256_US = 8,
    SOURCE_RING = 3,
    PASS = 1 << 0,
    DONE = 1 << 4,
    /* Section 2.17.1: wherever it was made, and however warm it is. */
    SLOWEST_KHZ = 1800,
    FASTEST_KHZ = 12000,
};

static uint32_t before_us;
static volatile bool unsound;

static bool has_passed(void)
{
    return (REG(FC0_STATUS) & (DONE | PASS)) == (DONE | PASS);
}

ONCE static void measure_within(uint32_t slowest_khz, uint32_t fastest_khz)
{
    REG(FC0_MIN_KHZ) = slowest_khz;
    REG(FC0_MAX_KHZ) = fastest_khz;
    REG(FC0_SRC) = SOURCE_RING;
    while (!(REG(FC0_STATUS) & DONE))
        ;
}

ONCE void clock_check_start(void)
{
    REG(FC0_REF_KHZ) = CRYSTAL_KHZ;
    REG(FC0_INTERVAL) = INTERVAL_256_US;
    measure_within(SLOWEST_KHZ, FASTEST_KHZ);
    unsound = !has_passed();
    const uint32_t khz = REG(FC0_RESULT) / 32u;
    measure_within(khz - khz / TOLERANCE, khz + khz / TOLERANCE);
    before_us = REG(TIMER_RAWL);
    REG(SYSTICK_RELOAD) = EVERY_US * CLOCK_MHZ - 1;
    REG(SYSTICK_VALUE) = 0;
    REG(SYSTICK_CONTROL) = SYSTICK_FROM_PROCESSOR | SYSTICK_INTERRUPT | SYSTICK_ENABLE;
}

/* A crystal that stands still ends neither a measurement nor the time of the timer. */
void clock_check_isr(void)
{
    const uint32_t since_us = REG(TIMER_RAWL) - before_us;
    before_us += since_us;
    unsound = unsound || since_us - (EVERY_US - EVERY_US / TOLERANCE) > EVERY_US / TOLERANCE * 2u || !has_passed();
    if (unsound)
        outputs_off();
    REG(FC0_SRC) = SOURCE_RING;
}

bool clock_check_sound(void)
{
    return !unsound;
}
