#include "clocks.h"

#include "rp2040.h"

enum {
    CRYSTAL_MHZ = 12,
    XOSC_1_TO_15_MHZ = 0xaa0,
    XOSC_ENABLE = 0xfab << 12,
    XOSC_START_CYCLES = CRYSTAL_MHZ * 1000 / 256, /* 1 ms, in units of 256 cycles */
    STABLE = 1u << 31,
    PLL_FEEDBACK = 125, /* 12 MHz x 125 = 1500 MHz, / 6 / 2 = 125 MHz; section 2.18.2.1 */
    PLL_DIVIDER_1 = 6,
    PLL_DIVIDER_2 = 2,
    PLL_PD = 1 << 0,
    PLL_POST_DIVIDER_PD = 1 << 3,
    PLL_VCO_PD = 1 << 5,
    REF_FROM_XOSC = 2,
    SYS_FROM_REF = 0,
    SYS_FROM_PLL = 1,
    PERI_ENABLE = 1 << 11,
    TICK_ENABLE = 1 << 9,
};

_Static_assert(CRYSTAL_MHZ * PLL_FEEDBACK == CLOCK_MHZ * PLL_DIVIDER_1 * PLL_DIVIDER_2, "the PLL gives the clock");

void blocks_restart(uint32_t reset_bits)
{
    REG_SET(RESETS_RESET) = reset_bits;
    REG_CLEAR(RESETS_RESET) = reset_bits;
    while ((REG(RESETS_DONE) & reset_bits) != reset_bits)
        ;
}

static void start_crystal(void)
{
    REG(XOSC_STARTUP) = XOSC_START_CYCLES;
    REG(XOSC_CTRL) = XOSC_ENABLE | XOSC_1_TO_15_MHZ;
    while (!(REG(XOSC_STATUS) & STABLE))
        ;
}

static void start_pll(void)
{
    blocks_restart(RESET_PLL_SYS);
    REG(PLL_SYS_CS) = 1; /* reference divider */
    REG(PLL_SYS_FBDIV) = PLL_FEEDBACK;
    REG_CLEAR(PLL_SYS_PWR) = PLL_PD | PLL_VCO_PD;
    while (!(REG(PLL_SYS_CS) & STABLE))
        ;
    REG(PLL_SYS_PRIM) = PLL_DIVIDER_1 << 16 | PLL_DIVIDER_2 << 12;
    REG_CLEAR(PLL_SYS_PWR) = PLL_POST_DIVIDER_PD;
}

static void select_source(uint32_t control, uint32_t selected, uint32_t source)
{
    REG(control) = source;
    while (REG(selected) != 1u << source)
        ;
}

void clocks_start(void)
{
    REG(CLK_SYS_RESUS_CTRL) = 0;
    start_crystal();
    select_source(CLK_SYS_CTRL, CLK_SYS_SELECTED, SYS_FROM_REF); /* off the PLL before the PLL is touched */
    select_source(CLK_REF_CTRL, CLK_REF_SELECTED, REF_FROM_XOSC);
    start_pll();
    select_source(CLK_SYS_CTRL, CLK_SYS_SELECTED, SYS_FROM_PLL);
    REG(CLK_PERI_CTRL) = PERI_ENABLE;
    REG(WATCHDOG_TICK) = TICK_ENABLE | CRYSTAL_MHZ; /* counts for the timer too */
}
