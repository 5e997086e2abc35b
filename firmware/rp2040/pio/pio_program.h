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
 * is the last limit of a light pulse: whatever is written into the FIFO, none can outlast PULSE_CYCLES_MAX.
 * A machine that gives pulse A alone returns to the start after it.
 *
 * Continuous light has a program of its own: pulses with dark between them, both as long as the program says, not
 * its words. A word permits up to 2^LIT_COUNT_BITS pulses. So a dead processor ends it, and no word can change it. */
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
_Static_assert(MAX_WIDTH_NS <= PULSE_CYCLES_MAX * TICK_NS, "the longest permitted pulse fits");
_Static_assert(MAX_WIDTH_NS + 100 > PULSE_CYCLES_MAX * TICK_NS, "and hardly more than that");
_Static_assert(MAX_SEPARATION_NS <= GAP_CYCLES_MAX * TICK_NS, "the longest permitted separation fits");
_Static_assert(CAMERA_PULSE_NS <= CAMERA_CYCLES_MAX * TICK_NS, "the camera pulse fits");
_Static_assert(MIN_WIDTH_NS >= COUNT_OFFSET * TICK_NS && MIN_DARK_NS >= COUNT_OFFSET * TICK_NS,
               "every permitted width and gap can be encoded");

/* Section 3.4. One side-set bit: the level of the machine's pin from the start of the instruction on. */
#define PIO_LOW (0u << 12)
#define PIO_HIGH (1u << 12)
#define PIO_JMP(address) (0x0000u | (address))
#define PIO_JMP_X_DEC(address) (0x0040u | (address)) /* if X is not 0; decrements X */
#define PIO_WAIT_PIN_LOW 0x2020u                     /* of the pin at IN_BASE */
#define PIO_WAIT_PIN_HIGH 0x20a0u
#define PIO_OUT_X(bits) (0x6020u | ((bits) & 31u))
#define PIO_PULL 0x80a0u /* stalls while the FIFO is empty */
#define PIO_PULL_IF_ANY 0x8080u
#define PIO_MOV_X_OSR 0xa027u
#define PIO_OUT_Y(bits) (0x6040u | ((bits) & 31u))
#define PIO_SET_X(value) (0xe020u | (value))
#define PIO_JMP_Y_DEC(address) (0x0080u | (address))
#define PIO_NOP 0xa042u
#define PIO_DELAY(cycles) ((cycles) << 8) /* after the instruction; up to 15 */

enum {
    PIO_TRIGGER_LOW_ADDRESS = 3,
    PIO_TRIGGER_ADDRESS = 4,
    LIGHT_SINGLE_LENGTH = 8, /* instructions up to the end of pulse A */
};

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

enum {
    LIT_COUNT_BITS = 8,
    LIT_DIVIDER = 10, /* system clocks per cycle */
    LIT_ON_CYCLES = 24,
    LIT_PERIOD_CYCLES = 1 + 32 * 16 + LIT_ON_CYCLES + 1,
    LIT_WORDS_MAX = 5, /* four in the FIFO, one under way */
};

static const uint16_t LIT_PROGRAM[] = {
    PIO_LOW | PIO_PULL,
    PIO_LOW | PIO_OUT_Y(LIT_COUNT_BITS),
    PIO_LOW | PIO_SET_X(31u),
    PIO_LOW | PIO_JMP_X_DEC(3u) | PIO_DELAY(15u),
    PIO_HIGH | PIO_NOP | PIO_DELAY(15u),
    PIO_HIGH | PIO_NOP | PIO_DELAY(7u),
    PIO_LOW | PIO_JMP_Y_DEC(2u),
};

_Static_assert(MAX_WIDTH_NS >= LIT_ON_CYCLES * LIT_DIVIDER * TICK_NS, "no pulse of continuous light is longer either");
_Static_assert(LIT_ON_CYCLES * 1000000ll <= MAX_LIGHT_DUTY_PPM * (long long)LIT_PERIOD_CYCLES,
               "and most of it is dark");
_Static_assert(LIGHT_SUSTAIN_MS * 1000000ll >=
                   (long long)LIT_WORDS_MAX * (LIT_PERIOD_CYCLES << LIT_COUNT_BITS) * LIT_DIVIDER * TICK_NS,
               "whatever the FIFO holds, it ends in time");

#endif
