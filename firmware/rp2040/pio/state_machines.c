#include "state_machines.h"

#include "pins.h"
#include "pio_program.h"
#include "rp2040.h"

enum {
    RESTART_ALL = 0x0f0,
    ENABLE_ALL = 0x00f,
    FIFO_DEPTH = 4,
    SHIFT_RIGHT = 1 << 18 | 1 << 19,
    SIDE_SET_1 = 1 << 29,
};

void state_machines_divide_clock(uint32_t pio, uint32_t machine, uint32_t cycles)
{
    REG(PIO_CLKDIV(pio, machine)) = cycles << 16;
}

void state_machines_set_up(uint32_t pio, uint32_t machine, uint32_t pin, uint32_t length)
{
    state_machines_divide_clock(pio, machine, 1);
    REG(PIO_EXECCTRL(pio, machine)) = (length - 1) << 12; /* wrap after the last instruction */
    REG(PIO_SHIFTCTRL(pio, machine)) = SHIFT_RIGHT;
    REG(PIO_PINCTRL(pio, machine)) = SIDE_SET_1 | PIN_TRIGGER << 15 | pin << 10;
    for (int i = 0; i < FIFO_DEPTH; i++)
        REG(PIO_INSTR(pio, machine)) = PIO_LOW | PIO_PULL_IF_ANY; /* no word of an interrupted shot survives */
    REG(PIO_INSTR(pio, machine)) = PIO_LOW | PIO_JMP(0);
}

void state_machines_write_program(uint32_t pio, const uint16_t *program, uint32_t length)
{
    REG(PIO_CTRL(pio)) = RESTART_ALL;
    for (uint32_t i = 0; i < length; i++)
        REG(PIO_INSTR_MEM(pio, i)) = program[i];
}

void state_machines_enable(uint32_t pio)
{
    REG(PIO_CTRL(pio)) = ENABLE_ALL;
}
