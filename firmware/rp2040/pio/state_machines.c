#include "state_machines.h"

#include "pins.h"
#include "pio_program.h"
#include "rp2040.h"

enum {
    RESTART_ALL = 0x0f0,
    ENABLE_ALL = 0x00f,
    FIFO_DEPTH = 4,
    MEMORY_SIZE = 16, /* of the longest program, and more */
    SHIFT_RIGHT = 1 << 18 | 1 << 19,
    SIDE_SET_1 = 1 << 29,
};

struct program {
    const uint16_t *instructions;
    uint32_t length;
};

static struct program programs[CAMERA + 1];

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

static void write_instructions(uint32_t pio, uint32_t from, uint32_t end)
{
    const struct program *program = &programs[pio];
    for (uint32_t address = from; address < end && address < program->length; address++)
        REG(PIO_INSTR_MEM(pio, address)) = program->instructions[address];
}

void state_machines_write_program(uint32_t pio, const uint16_t *program, uint32_t length)
{
    REG(PIO_CTRL(pio)) = RESTART_ALL;
    programs[pio] = (struct program){program, length};
    write_instructions(pio, 0, length);
}

void state_machines_refresh(void)
{
    for (uint32_t pio = LIGHT; pio <= CAMERA; pio++)
        if (REG(PIO_CTRL(pio)))
            write_instructions(pio, 0, MEMORY_SIZE);
}

void state_machines_poll(void)
{
    static uint32_t address;
    address = (address + 1u) % MEMORY_SIZE;
    for (uint32_t pio = LIGHT; pio <= CAMERA; pio++)
        if (REG(PIO_CTRL(pio)))
            write_instructions(pio, address, address + 1u);
}

void state_machines_enable(uint32_t pio)
{
    REG(PIO_CTRL(pio)) = ENABLE_ALL;
}
