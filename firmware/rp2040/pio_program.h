/* The programs of the state machines, one instruction per line.
 *
 * Both begin alike, so that camera trigger and light of equal delays rise in the same cycle. Each shot takes two
 * words, pushed just before it; without them a machine stands at its first or second PULL with its pin low. So one
 * shot needs one action of the processor, and a dead processor cannot repeat a pulse.
 *
 *     light   word 1: cycles from trigger to pulse A      word 2: width of A, gap, width of B
 *     camera  word 1: cycles from trigger to the edge     word 2: width
 *
 * A width w is encoded as w - 2, because OUT takes one cycle and the loop one more than its count. The width field
 * is the last limit of a light pulse: whatever is written into the FIFO, none can outlast PULSE_CYCLES_MAX. */
#ifndef PIO_PROGRAM_H
#define PIO_PROGRAM_H

#include <stdint.h>

#include "clocks.h"
#include "limits.h"

enum pio_field {
    WIDTH_BITS = 8,
    GAP_BITS = 16,
    CAMERA_BITS = 11,
    COUNT_OFFSET = 2,
    PULSE_CYCLES_MAX = (1 << WIDTH_BITS) - 1 + COUNT_OFFSET,
    GAP_CYCLES_MAX = (1 << GAP_BITS) - 1 + COUNT_OFFSET,
    CAMERA_CYCLES_MAX = (1 << CAMERA_BITS) - 1 + COUNT_OFFSET,
};

_Static_assert(2 * WIDTH_BITS + GAP_BITS <= 32, "pulse A, gap and pulse B fit one word");
_Static_assert(PULSE_CYCLES_MAX * TICK_NS >= MAX_WIDTH_NS, "the longest permitted pulse fits");
_Static_assert(PULSE_CYCLES_MAX * TICK_NS < MAX_WIDTH_NS + 100, "and hardly more than that");
_Static_assert(GAP_CYCLES_MAX * TICK_NS >= MAX_SEPARATION_NS, "the longest permitted separation fits");
_Static_assert(CAMERA_CYCLES_MAX * TICK_NS >= CAMERA_PULSE_NS, "the camera pulse fits");
_Static_assert(MIN_WIDTH_NS >= COUNT_OFFSET * TICK_NS && MIN_DARK_NS >= COUNT_OFFSET * TICK_NS,
               "every permitted width and gap can be encoded");

/* Section 3.4. One side-set bit: the level of the machine's pin from the start of the instruction on. */
#define PIO_LOW (0u << 12)
#define PIO_HIGH (1u << 12)
#define PIO_JMP(address) (0x0000u | (address))
#define PIO_JMP_X_DEC(address) (0x0040u | (address)) /* if X is not 0; decrements X */
#define PIO_WAIT_PIN_LOW 0x2020u                      /* of the pin at IN_BASE */
#define PIO_WAIT_PIN_HIGH 0x20a0u
#define PIO_OUT_X(bits) (0x6020u | ((bits) & 31u))
#define PIO_PULL 0x80a0u /* stalls while the FIFO is empty */
#define PIO_PULL_IF_ANY 0x8080u
#define PIO_MOV_X_OSR 0xa027u

enum { PIO_TRIGGER_ADDRESS = 4 };

static const uint16_t LIGHT_PROGRAM[] = {
    PIO_LOW | PIO_PULL,
    PIO_LOW | PIO_MOV_X_OSR,
    PIO_LOW | PIO_PULL,
    PIO_LOW | PIO_WAIT_PIN_LOW, /* an edge, not a level: a line that is stuck high starts nothing */
    PIO_LOW | PIO_WAIT_PIN_HIGH,
    PIO_LOW | PIO_JMP_X_DEC(5u),
    PIO_HIGH | PIO_OUT_X(WIDTH_BITS), /* pulse A */
    PIO_HIGH | PIO_JMP_X_DEC(7u),
    PIO_LOW | PIO_OUT_X(GAP_BITS),
    PIO_LOW | PIO_JMP_X_DEC(9u),
    PIO_HIGH | PIO_OUT_X(WIDTH_BITS), /* pulse B */
    PIO_HIGH | PIO_JMP_X_DEC(11u),
};

static const uint16_t CAMERA_PROGRAM[] = {
    PIO_LOW | PIO_PULL,
    PIO_LOW | PIO_MOV_X_OSR,
    PIO_LOW | PIO_PULL,
    PIO_LOW | PIO_WAIT_PIN_LOW,
    PIO_LOW | PIO_WAIT_PIN_HIGH,
    PIO_LOW | PIO_JMP_X_DEC(5u),
    PIO_HIGH | PIO_OUT_X(CAMERA_BITS),
    PIO_HIGH | PIO_JMP_X_DEC(7u),
};

#endif
