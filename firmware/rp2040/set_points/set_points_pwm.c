/* PWM at 41.7 kHz, full scale is MAX_CURRENT_MA; nothing comes back from it. */
#include "pins.h"
#include "resets.h"
#include "rp2040.h"
#include "set_points.h"

enum {
    FULL_SCALE = MAX_CURRENT_MA / SET_POINT_STEP_MA, /* clock cycles of one period */
    SLICES = CHANNEL_COUNT / 2,
    SLICE_ENABLE = 1,
};

_Static_assert(PIN_SET_POINT % 16 == 0, "channel 0 and 1 are slice 0, channel 2 and 3 slice 1");
_Static_assert(MAX_CURRENT_MA % SET_POINT_STEP_MA == 0 && FULL_SCALE <= UINT16_MAX, "full scale is a compare value");

static void drive_pins(uint32_t override)
{
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++)
        REG(IO_CTRL(PIN_SET_POINT + i)) = FUNCTION_PWM | override;
}

void set_points_zero(void)
{
    drive_pins(OUTPUT_LOW); /* at once; the compare value counts from the next period on */
    for (uint32_t slice = 0; slice < SLICES; slice++)
        REG(PWM_CC(slice)) = 0;
}

ONCE void set_points_start(void)
{
    resets_restart(RESET_PWM);
    set_points_zero();
    for (uint32_t slice = 0; slice < SLICES; slice++) {
        REG(PWM_TOP(slice)) = FULL_SCALE - 1;
        REG(PWM_CSR(slice)) = SLICE_ENABLE;
    }
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++)
        REG(PAD(PIN_SET_POINT + i)) = PAD_INPUT | PAD_4_MA | PAD_PULL_DOWN | PAD_SCHMITT;
}

static uint32_t level(uint32_t current_ma)
{
    const uint32_t permitted_ma = current_ma < MAX_CURRENT_MA ? current_ma : MAX_CURRENT_MA;
    return (permitted_ma + SET_POINT_STEP_MA / 2u) / SET_POINT_STEP_MA;
}

bool set_points_set(const uint32_t current_ma[CHANNEL_COUNT])
{
    const uint32_t before = interrupts_mask(); /* or an OFF that comes meanwhile would be undone */
    for (uint32_t slice = 0; slice < SLICES; slice++)
        REG(PWM_CC(slice)) = level(current_ma[2 * slice]) | level(current_ma[2 * slice + 1]) << 16;
    drive_pins(0);
    interrupts_restore(before);
    return true;
}

void set_points_poll(void)
{
}

bool set_points_confirmed(void)
{
    return true;
}
