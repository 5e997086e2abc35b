#include "continuous_light.h"

#include "outputs.h"
#include "pins.h"
#include "pio_program.h"
#include "rp2040.h"
#include "set_points.h"
#include "state_machines.h"

enum { LAST_PULSE = (1 << LIT_COUNT_BITS) - 1 };

static bool lit[CHANNEL_COUNT];

static void give_light_pins(void)
{
    state_machines_write_program(LIGHT, LIT_PROGRAM, PROGRAM_LENGTH(LIT_PROGRAM));
    for (uint32_t i = 0; i < MACHINES; i++) {
        state_machines_set_up(LIGHT, i, PIN_LIGHT + i, PROGRAM_LENGTH(LIT_PROGRAM));
        state_machines_divide_clock(LIGHT, i, LIT_DIVIDER);
        if (lit[i])
            outputs_give_light(i);
    }
    state_machines_enable(LIGHT);
}

bool continuous_light_prepare(const uint32_t *current_ma)
{
    const uint32_t off_before = outputs_switch_off();
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++) {
        lit[i] = current_ma[i] > 0;
        if (current_ma[i] > MAX_LIGHT_MA) /* the core has checked; this is the last place to ask */
            return false;
    }
    if (!set_points_set(current_ma))
        return false;
    uint32_t before = 0;
    const bool still_wanted = outputs_mask_unless_off(off_before, &before);
    if (still_wanted)
        give_light_pins();
    interrupts_restore(before);
    return still_wanted;
}

void continuous_light_sustain(void)
{
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++)
        if (lit[i] && REG(PIO_FSTAT(LIGHT)) & PIO_TX_EMPTY(i))
            REG(PIO_TXF(LIGHT, i)) = LAST_PULSE;
}
