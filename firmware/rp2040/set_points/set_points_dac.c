/* MCP4728: four channels of 12 bits, 0.5 mV per step from its own reference, 20 A/V at the drivers. Zero is its
 * power-down, which pulls the output to ground by 1 kOhm: an amplifier set to 0 V may give 20 mV. DS22187E. */
#include "i2c.h"
#include "rp2040.h"
#include "set_points.h"

enum {
    MULTI_WRITE = 0x40, /* section 5.6.2: this channel's register, not its EEPROM */
    REFERENCE = 1 << 7, /* of the upper byte of a register: the internal one; on, gain 1 */
    POWER_DOWN = 1 << 5,
    FAST_POWER_DOWN = 1 << 4,
    CHANNEL_SHIFT = 1,
    WRITE_BYTES = 3, /* per channel */
    READ_BYTES = 6,  /* per channel: status and register, then the same of the EEPROM */
    ATTEMPTS = 3,
    PAUSE_US = 100000,
};

/* Fast write, section 5.6.1: all four registers. Short enough for the queue behind a busy interrupt. */
static const uint8_t ALL_ZERO[2 * CHANNEL_COUNT] = {FAST_POWER_DOWN, 0, FAST_POWER_DOWN, 0,
                                                    FAST_POWER_DOWN, 0, FAST_POWER_DOWN, 0};

_Static_assert(I2C_FIFO >= WRITE_BYTES * CHANNEL_COUNT && I2C_FIFO >= sizeof ALL_ZERO, "a write fits the queue");
_Static_assert(MAX_CURRENT_MA / SET_POINT_STEP_MA < 1 << 12, "full scale fits 12 bits");

static volatile bool zero_due; /* asked for, not confirmed yet */
static bool failed;            /* the newest attempt to confirm it; tried again after a pause */
static uint32_t failed_us;

void set_points_zero(void)
{
    zero_due = true;
    (void)i2c_post(ALL_ZERO, sizeof ALL_ZERO); /* busy: the main loop is waiting for the bus, and comes to it */
}

void set_points_start(void)
{
    i2c_restart();
    set_points_zero();
}

static uint32_t register_of(uint32_t current_ma)
{
    const uint32_t steps = (current_ma + SET_POINT_STEP_MA / 2u) / SET_POINT_STEP_MA;
    return (steps ? REFERENCE : POWER_DOWN) * 256u + steps;
}

static bool write_registers(const uint32_t current_ma[CHANNEL_COUNT])
{
    uint8_t bytes[WRITE_BYTES * CHANNEL_COUNT];
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++) {
        const uint32_t value = register_of(current_ma[i]);
        bytes[WRITE_BYTES * i] = (uint8_t)(MULTI_WRITE | i << CHANNEL_SHIFT);
        bytes[WRITE_BYTES * i + 1] = (uint8_t)(value >> 8);
        bytes[WRITE_BYTES * i + 2] = (uint8_t)value;
    }
    return i2c_write(bytes, sizeof bytes);
}

/* What is off needs no reference. */
static bool same(uint32_t read, uint32_t wanted)
{
    return read == wanted || (wanted == POWER_DOWN * 256u && read == (REFERENCE | POWER_DOWN) * 256u);
}

static bool read_back(const uint32_t current_ma[CHANNEL_COUNT])
{
    uint8_t bytes[READ_BYTES * CHANNEL_COUNT];
    bool equal = i2c_read(bytes, sizeof bytes);
    for (uint32_t i = 0; equal && i < CHANNEL_COUNT; i++) {
        const uint8_t *channel = &bytes[READ_BYTES * i];
        equal = (channel[0] >> 4 & 3u) == i && same((uint32_t)channel[1] << 8 | channel[2], register_of(current_ma[i]));
    }
    return equal;
}

static bool set_and_read_back(const uint32_t current_ma[CHANNEL_COUNT])
{
    for (int i = 0; i < ATTEMPTS; i++) {
        if (write_registers(current_ma) && read_back(current_ma))
            return true;
        i2c_restart();
    }
    return false;
}

bool set_points_set(const uint32_t current_ma[CHANNEL_COUNT])
{
    zero_due = false;
    const bool set = set_and_read_back(current_ma);
    failed = failed && !set;
    return set;
}

void set_points_poll(void)
{
    static const uint32_t zero_ma[CHANNEL_COUNT];
    if (!zero_due || (failed && REG(TIMER_RAWL) - failed_us < PAUSE_US))
        return;
    failed = !set_and_read_back(zero_ma);
    failed_us = REG(TIMER_RAWL);
    zero_due = failed;
}

bool set_points_confirmed(void)
{
    return !failed;
}
