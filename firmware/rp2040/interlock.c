#include "interlock.h"

#include "outputs.h"
#include "pins.h"
#include "rp2040.h"
#include "vectors.h"

static volatile bool opened; /* since the core last asked */

void interlock_start(void)
{
    REG(PAD(PIN_INTERLOCK)) = PAD_INPUT | PAD_PULL_DOWN | PAD_SCHMITT; /* a cut wire reads as open */
    REG(IO_CTRL(PIN_INTERLOCK)) = FUNCTION_SIO;
    REG(IO_INTR(PIN_INTERLOCK)) = IO_EDGE_LOW(PIN_INTERLOCK);
    REG(IO_INTE(PIN_INTERLOCK)) = IO_EDGE_LOW(PIN_INTERLOCK);
}

void isr_io_bank0(void)
{
    outputs_off();
    opened = true;
    REG(IO_INTR(PIN_INTERLOCK)) = IO_EDGE_LOW(PIN_INTERLOCK);
}

bool interlock_take_closed(void)
{
    const uint32_t before = interrupts_mask();
    const bool closed = !opened && (REG(SIO_GPIO_IN) >> PIN_INTERLOCK & 1u);
    opened = false;
    interrupts_restore(before);
    return closed;
}
