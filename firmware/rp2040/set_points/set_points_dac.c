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
    EEPROM_WRITE = 0x50, /* section 5.6.3: all channels, and what they do after power-up */
    READY = 1 << 7,      /* of the status: the EEPROM is not being written */
    EEPROM_WRITE_US = 60000,
    EEPROM_WRITES = 3, /* per start */
    CHANNEL_SHIFT = 1,
    WRITE_BYTES = 3, /* per channel */
    READ_BYTES = 6,  /* per channel: status and register, then the same of the EEPROM */
    ATTEMPTS = 3,
    PAUSE_US = 100000,
    CHECK_EVERY_US = 10000, /* at least one shot is given in this time; zeros can wait longer */
    CHECK_ZEROS_EVERY_US = 100000,
    CHECK_LIMIT_US = 10000,
    MISSES = 2, /* one may be a disturbance by a shot */
};

/* Fast write, section 5.6.1: all four registers. Short enough for the queue behind a busy interrupt. */
static const uint8_t ALL_ZERO[2 * CHANNEL_COUNT] = {FAST_POWER_DOWN, 0, FAST_POWER_DOWN, 0,
                                                    FAST_POWER_DOWN, 0, FAST_POWER_DOWN, 0};

_Static_assert(I2C_FIFO >= WRITE_BYTES * CHANNEL_COUNT && I2C_FIFO >= sizeof ALL_ZERO, "a write fits the queue");
_Static_assert(MAX_CURRENT_MA / SET_POINT_STEP_MA < 1 << 12, "full scale fits 12 bits");

static volatile bool zero_due; /* asked for, not confirmed yet */
static bool failed;            /* the newest attempt to confirm it, or a check; tried again after a pause */
static uint32_t pause_us;
static uint32_t tried_us;

static uint32_t wanted_ma[CHANNEL_COUNT]; /* what was set and read back last */
static uint8_t answer[READ_BYTES * CHANNEL_COUNT];
static bool checking;
static uint32_t checked_us; /* or started to be */
static uint32_t misses;
static uint32_t eeprom_writes;

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
    const uint32_t permitted_ma =
        current_ma < MAX_CURRENT_MA ? current_ma : MAX_CURRENT_MA; /* the bits above are others */
    const uint32_t steps = (permitted_ma + SET_POINT_STEP_MA / 2u) / SET_POINT_STEP_MA;
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

/* Number, reference, power-down, gain and steps of every channel. */
static bool answer_is(const uint32_t current_ma[CHANNEL_COUNT])
{
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++) {
        const uint8_t *channel = &answer[READ_BYTES * i];
        if ((channel[0] >> 4 & 3u) != i || !same((uint32_t)channel[1] << 8 | channel[2], register_of(current_ma[i])))
            return false;
    }
    return true;
}

/* Until the firmware has started, the outputs are what the EEPROM says. */
static bool eeprom_is_zero(void)
{
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++) {
        const uint8_t *kept = &answer[READ_BYTES * i + READ_BYTES / 2];
        if (!(kept[0] & READY) || (!(kept[1] & 3u << 5) && (kept[1] & 15u || kept[2])))
            return false;
    }
    return true;
}

static void stop_checking(void)
{
    if (checking)
        i2c_restart();
    checking = false;
    misses = 0;
    checked_us = REG(TIMER_RAWL);
}

static bool set_and_read_back(const uint32_t current_ma[CHANNEL_COUNT])
{
    stop_checking();
    for (int i = 0; i < ATTEMPTS; i++) {
        if (write_registers(current_ma) && i2c_read(answer, sizeof answer) && answer_is(current_ma)) {
            for (uint32_t k = 0; k < CHANNEL_COUNT; k++)
                wanted_ma[k] = current_ma[k];
            return true;
        }
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

static void try_again_after(uint32_t time_us)
{
    zero_due = true;
    pause_us = time_us;
    tried_us = REG(TIMER_RAWL);
}

/* It takes up to 50 ms, in which the converter does nothing else. */
static bool write_eeprom(void)
{
    static const uint8_t OFF[1 + 2 * CHANNEL_COUNT] = {EEPROM_WRITE, POWER_DOWN, 0,          POWER_DOWN, 0,
                                                       POWER_DOWN,   0,          POWER_DOWN, 0};
    return eeprom_writes++ < EEPROM_WRITES && i2c_write(OFF, sizeof OFF);
}

static void confirm_zero(void)
{
    static const uint32_t ZERO_MA[CHANNEL_COUNT];
    zero_due = false;
    pause_us = 0;
    failed = !set_and_read_back(ZERO_MA);
    if (failed) {
        try_again_after(PAUSE_US);
    } else if (!eeprom_is_zero()) {
        failed = !write_eeprom();
        try_again_after(failed ? PAUSE_US : EEPROM_WRITE_US);
    }
}

static bool any_wanted(void)
{
    return wanted_ma[0] || wanted_ma[1] || wanted_ma[2] || wanted_ma[3];
}

static void end_check(bool right)
{
    checking = false;
    checked_us = REG(TIMER_RAWL);
    misses = right ? 0 : misses + 1u;
    if (!right)
        i2c_restart();
    if (misses < MISSES)
        return;
    failed = true;
    misses = 0;
    try_again_after(0);
}

/* Without waiting: a byte takes 23 us. */
static void check(uint32_t since_us)
{
    if (!checking) {
        const uint32_t every_us = any_wanted() ? CHECK_EVERY_US : CHECK_ZEROS_EVERY_US;
        checking = (misses || since_us >= every_us) && i2c_start_read();
        checked_us += checking ? since_us : 0u;
        return;
    }
    const enum i2c_progress progress = i2c_go_on(answer, sizeof answer);
    if (progress != I2C_UNDER_WAY)
        end_check(progress == I2C_DONE && answer_is(wanted_ma));
    else if (since_us > CHECK_LIMIT_US)
        end_check(false);
}

void set_points_poll(void)
{
    if (!zero_due)
        check(REG(TIMER_RAWL) - checked_us);
    else if (REG(TIMER_RAWL) - tried_us >= pause_us)
        confirm_zero();
}

bool set_points_confirmed(void)
{
    return !failed;
}
