/* The two PIO blocks: light, and camera triggers; a machine for each channel. */
#ifndef STATE_MACHINES_H
#define STATE_MACHINES_H

#include <stdint.h>

#include "limits.h"

enum {
    LIGHT = 0, /* number of the PIO block */
    CAMERA = 1,
    MACHINES = CHANNEL_COUNT,
};

#define PROGRAM_LENGTH(program) (uint32_t)(sizeof(program) / sizeof *(program))

/* Stop all machines of a block and give them a program. */
void state_machines_write_program(uint32_t pio, const uint16_t *program, uint32_t length);

/* Their memory cannot be read, so the programs of machines that run are written once more: whole, and, from the main loop
 * all the time, instruction by instruction. */
void state_machines_refresh(void);
void state_machines_poll(void);

/* Its pin, and the first so many instructions of the program; it starts at their beginning, without words. */
void state_machines_set_up(uint32_t pio, uint32_t machine, uint32_t pin, uint32_t length);

/* An instruction takes this many cycles; after state_machines_set_up. */
void state_machines_divide_clock(uint32_t pio, uint32_t machine, uint32_t cycles);

void state_machines_enable(uint32_t pio);

#endif
