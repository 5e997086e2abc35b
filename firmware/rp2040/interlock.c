#include "interlock.h"

#include "outputs.h"
#include "pins.h"
#include "rp2040.h"

/* One register has them all. */
_Static_assert(PIN_TRIGGER / 8 == PIN_INTERLOCK / 8 && PIN_ESTOP / 8 == PIN_INTERLOCK / 8, "pins 8 to 15");
#define OPENED (IO_EDGE_LOW(PIN_INTERLOCK) | IO_EDGE_LOW(PIN_ESTOP))
#define RISEN IO_EDGE_HIGH(PIN_TRIGGER)

static volatile uint32_t opened; /* since the core last asked */
static volatile struct port_edges edges;

ONCE static void set_input(uint32_t pin)
{
    REG(PAD(pin)) = PAD_INPUT | PAD_PULL_DOWN | PAD_SCHMITT; /* a cut wire reads as open */
    REG(IO_CTRL(pin)) = FUNCTION_SIO;
}

ONCE void interlock_start(void)
{
    set_input(PIN_INTERLOCK);
    set_input(PIN_ESTOP);
    REG(IO_INTR(PIN_INTERLOCK)) = OPENED | RISEN;
    REG(IO_INTE(PIN_INTERLOCK)) = OPENED | RISEN;
}

/* Whether a rise has started the shot is asked here, for each of them: later two would look like one. */
void interlock_isr(void)
{
    const uint32_t pending = REG(IO_INTS(PIN_INTERLOCK));
    if (pending & OPENED) {
        outputs_off();
        opened |= pending & OPENED;
    }
    REG(IO_INTR(PIN_INTERLOCK)) = pending;
    if (pending & RISEN) {
        edges.rises++;
        edges.fired |= outputs_take_start();
    }
}

static bool take_closed(uint32_t pin)
{
    const uint32_t before = interrupts_mask();
    const bool closed = !(opened & IO_EDGE_LOW(pin)) && (REG(SIO_GPIO_IN) >> pin & 1u);
    opened &= ~IO_EDGE_LOW(pin);
    interrupts_restore(before);
    return closed;
}

bool interlock_take_closed(void)
{
    return take_closed(PIN_INTERLOCK);
}

bool interlock_take_estop_closed(void)
{
    return take_closed(PIN_ESTOP);
}

struct port_edges interlock_take_edges(void)
{
    const uint32_t before = interrupts_mask();
    const struct port_edges taken = {edges.rises, edges.fired};
    edges.rises = 0;
    edges.fired = false;
    interrupts_restore(before);
    return taken;
}
