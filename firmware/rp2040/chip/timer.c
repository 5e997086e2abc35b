#include "timer.h"

#include "resets.h"
#include "rp2040.h"

enum { ALARM0 = 1 };

ONCE void timer_start(void)
{
    resets_restart(RESET_TIMER);
    REG(TIMER_DBGPAUSE) = 0; /* a processor that a debugger has halted is a silent host too */
    REG(TIMER_INTE) = ALARM0;
}

uint64_t timer_now_us(void)
{
    uint32_t high = 0;
    uint32_t low = 0;
    do {
        high = REG(TIMER_RAWH);
        low = REG(TIMER_RAWL);
    } while (high != REG(TIMER_RAWH));
    return (uint64_t)high << 32 | low;
}

void timer_set_alarm(uint32_t time_us)
{
    REG(TIMER_ALARM0) = REG(TIMER_RAWL) + time_us;
}

void timer_isr(void)
{
    REG(TIMER_INTR) = ALARM0;
}
