#include "clocks.h"

#include "resets.h"
#include "rp2040.h"

enum {
    CRYSTAL_MHZ = 12,
    XOSC_1_TO_15_MHZ = 0xaa0,
    XOSC_ENABLE = 0xfab << 12,
    XOSC_START_CYCLES = CRYSTAL_MHZ * 1000 / 256, /* 1 ms, in units of 256 cycles */
    STABLE = 1u << 31,
    USB_MHZ = 48,
    PLL_PD = 1 << 0,
    PLL_POST_DIVIDER_PD = 1 << 3,
    PLL_VCO_PD = 1 << 5,
    REF_FROM_XOSC = 2,
    SYS_FROM_REF = 0,
    SYS_FROM_PLL = 1,
    PERI_ENABLE = 1 << 11,
    USB_ENABLE = 1 << 11,
    TICK_ENABLE = 1 << 9,
};

/* Section 2.18.2.1. */
struct pll {
    uint32_t base;
    uint32_t reset_bit;
    uint32_t feedback;
    uint32_t divider_1;
    uint32_t divider_2;
};

enum {
    SYS_FEEDBACK = 125, /* 12 MHz x 125 = 1500 MHz, / 6 / 2 = 125 MHz */
    SYS_DIVIDER_1 = 6,
    SYS_DIVIDER_2 = 2,
    USB_FEEDBACK = 100, /* 1200 MHz, / 5 / 5 = 48 MHz */
    USB_DIVIDER = 5,
};

_Static_assert((CRYSTAL_MHZ * SYS_FEEDBACK) == CLOCK_MHZ * SYS_DIVIDER_1 * SYS_DIVIDER_2, "the PLL gives the clock");
_Static_assert((CRYSTAL_MHZ * USB_FEEDBACK) == USB_MHZ * USB_DIVIDER * USB_DIVIDER, "the other one that of the USB");

ONCE static void start_crystal(void)
{
    REG(XOSC_STARTUP) = XOSC_START_CYCLES;
    REG(XOSC_CTRL) = XOSC_ENABLE | XOSC_1_TO_15_MHZ;
    while (!(REG(XOSC_STATUS) & STABLE))
        ;
}

ONCE static void start_pll(const struct pll *pll)
{
    resets_restart(pll->reset_bit);
    REG(PLL_CS(pll->base)) = 1; /* reference divider */
    REG(PLL_FBDIV(pll->base)) = pll->feedback;
    REG_CLEAR(PLL_PWR(pll->base)) = PLL_PD | PLL_VCO_PD;
    while (!(REG(PLL_CS(pll->base)) & STABLE))
        ;
    REG(PLL_PRIM(pll->base)) = pll->divider_1 << 16 | pll->divider_2 << 12;
    REG_CLEAR(PLL_PWR(pll->base)) = PLL_POST_DIVIDER_PD;
}

ONCE static void select_source(uint32_t control, uint32_t selected, uint32_t source)
{
    REG(control) = source;
    while (REG(selected) != 1u << source)
        ;
}

ONCE void clocks_start(void)
{
    static const struct pll SYS = {PLL_SYS, RESET_PLL_SYS, SYS_FEEDBACK, SYS_DIVIDER_1, SYS_DIVIDER_2};
    REG(CLK_SYS_RESUS_CTRL) = 0;
    start_crystal();
    select_source(CLK_SYS_CTRL, CLK_SYS_SELECTED, SYS_FROM_REF); /* off the PLL before the PLL is touched */
    select_source(CLK_REF_CTRL, CLK_REF_SELECTED, REF_FROM_XOSC);
    start_pll(&SYS);
    select_source(CLK_SYS_CTRL, CLK_SYS_SELECTED, SYS_FROM_PLL);
    REG(CLK_PERI_CTRL) = PERI_ENABLE;
    REG(WATCHDOG_TICK) = TICK_ENABLE | CRYSTAL_MHZ; /* counts for the timer too */
}

ONCE void clocks_start_usb(void)
{
    static const struct pll USB = {PLL_USB, RESET_PLL_USB, USB_FEEDBACK, USB_DIVIDER, USB_DIVIDER};
    start_pll(&USB);
    REG(CLK_USB_CTRL) = USB_ENABLE; /* from that PLL, undivided */
}
