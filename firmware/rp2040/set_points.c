#include "set_points.h"

#include "pins.h"
#include "rp2040.h"

enum {
    STEP_MA = 10,
    FULL_SCALE = MAX_CURRENT_MA / STEP_MA, /* clock cycles of one period */
    SLICES = CHANNEL_COUNT / 2,
    SLICE_ENABLE = 1,
};

_Static_assert(PIN_SET_POINT % 16 == 0, "channel 0 and 1 are slice 0, channel 2 and 3 slice 1");
_Static_assert(MAX_CURRENT_MA % STEP_MA == 0 && FULL_SCALE <= UINT16_MAX, "full scale is a compare value");

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

void set_points_start(void)
{
    set_points_zero();
    for (uint32_t slice = 0; slice < SLICES; slice++) {
        REG(PWM_TOP(slice)) = FULL_SCALE - 1;
        REG(PWM_CSR(slice)) = SLICE_ENABLE;
    }
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++)
        REG(PAD(PIN_SET_POINT + i)) = PAD_INPUT | PAD_4_MA | PAD_PULL_DOWN | PAD_SCHMITT;
}

static uint32_t level(const struct channel *channel)
{
    return channel->used ? (channel->current_ma + STEP_MA / 2u) / STEP_MA : 0;
}

void set_points_set(const struct pulse_train *train)
{
    for (uint32_t slice = 0; slice < SLICES; slice++)
        REG(PWM_CC(slice)) = level(&train->channels[2 * slice]) | level(&train->channels[2 * slice + 1]) << 16;
    drive_pins(0);
}
