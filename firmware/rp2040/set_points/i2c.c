#include "i2c.h"

#include "clocks.h"
#include "pins.h"
#include "resets.h"
#include "rp2040.h"

enum {
    DEVICE = 0x60, /* MCP4728 as delivered */
    BUS_KHZ = 400,
    PERIOD_CYCLES = CLOCK_MHZ * 1000 / BUS_KHZ,
    LOW_CYCLES = PERIOD_CYCLES * 3 / 5,
    HIGH_CYCLES = PERIOD_CYCLES - LOW_CYCLES,
    DATA_HOLD_CYCLES = CLOCK_MHZ * 3 / 10 + 1, /* 300 ns */
    SPIKE_CYCLES = CLOCK_MHZ / 20,             /* 50 ns */
    LIMIT_US = 2000,                           /* 25 bytes take 570 us */
    RECOVERY_CLOCKS = 9,                       /* the rest of a byte and its acknowledge bit */
    RECOVERY_HALF_PERIOD_US = 5,
};

static const uint32_t LINES = 1u << PIN_I2C_SDA | 1u << PIN_I2C_SCL;
static volatile bool started;
static uint32_t asked; /* bytes of the read under way */
static uint32_t taken;

static uint32_t now_us(void)
{
    return REG(TIMER_RAWL);
}

static void wait_us(uint32_t time_us)
{
    const uint32_t start_us = now_us();
    while (now_us() - start_us <= time_us)
        ;
}

/* Both lines are pulled up, outside and here: low is driven, high is let go. */
static void set_pins(uint32_t function)
{
    REG(IO_CTRL(PIN_I2C_SDA)) = function;
    REG(IO_CTRL(PIN_I2C_SCL)) = function;
    REG(PAD(PIN_I2C_SDA)) = PAD_INPUT | PAD_4_MA | PAD_PULL_UP | PAD_SCHMITT;
    REG(PAD(PIN_I2C_SCL)) = PAD_INPUT | PAD_4_MA | PAD_PULL_UP | PAD_SCHMITT;
}

static void drive(uint32_t direction, uint32_t pin)
{
    REG(direction) = 1u << pin;
    wait_us(RECOVERY_HALF_PERIOD_US);
}

/* Clocks until the device lets go, then a stop condition. */
static void clear_bus(void)
{
    REG(SIO_GPIO_OUT_CLR) = LINES;
    REG(SIO_GPIO_OE_CLR) = LINES;
    set_pins(FUNCTION_SIO);
    for (int i = 0; i < RECOVERY_CLOCKS; i++) {
        drive(SIO_GPIO_OE_SET, PIN_I2C_SCL);
        drive(SIO_GPIO_OE_CLR, PIN_I2C_SCL);
    }
    drive(SIO_GPIO_OE_SET, PIN_I2C_SCL);
    drive(SIO_GPIO_OE_SET, PIN_I2C_SDA);
    drive(SIO_GPIO_OE_CLR, PIN_I2C_SCL);
    drive(SIO_GPIO_OE_CLR, PIN_I2C_SDA);
}

void i2c_restart(void)
{
    started = false;
    resets_restart(RESET_I2C0); /* forgets what is queued */
    clear_bus();
    REG(I2C_CON) = I2C_CON_MASTER;
    REG(I2C_TAR) = DEVICE;
    REG(I2C_FS_SCL_HCNT) = HIGH_CYCLES;
    REG(I2C_FS_SCL_LCNT) = LOW_CYCLES;
    REG(I2C_FS_SPKLEN) = SPIKE_CYCLES;
    REG(I2C_SDA_HOLD) = DATA_HOLD_CYCLES;
    REG(I2C_INTR_MASK) = 0;
    REG(I2C_ENABLE) = 1;
    set_pins(FUNCTION_I2C);
    started = true;
}

bool i2c_idle(void)
{
    return started && (REG(I2C_STATUS) & (I2C_STATUS_MASTER_ACTIVE | I2C_STATUS_TX_EMPTY)) == I2C_STATUS_TX_EMPTY;
}

bool i2c_post(const uint8_t *bytes, uint32_t count)
{
    const uint32_t before = interrupts_mask(); /* or an interrupt that posts would fall between the bytes */
    const bool idle = i2c_idle();
    if (idle) {
        (void)REG(I2C_CLR_TX_ABRT); /* an error of before keeps the queue closed */
        for (uint32_t i = 0; i < count; i++)
            REG(I2C_DATA_CMD) = bytes[i] | (i + 1 == count ? I2C_CMD_STOP : 0u);
    }
    interrupts_restore(before);
    return idle;
}

static bool refused(void)
{
    return REG(I2C_RAW_INTR_STAT) & I2C_INTR_TX_ABRT;
}

static bool wait_idle(void)
{
    const uint32_t start_us = now_us();
    while (!i2c_idle())
        if (now_us() - start_us > LIMIT_US)
            return false;
    return true;
}

bool i2c_write(const uint8_t *bytes, uint32_t count)
{
    return wait_idle() && i2c_post(bytes, count) && wait_idle() && !refused();
}

bool i2c_start_read(void)
{
    asked = taken = 0;
    return i2c_post(0, 0);
}

/* Keeps the queue of commands filled without overrunning the one of the bytes that come back. */
enum i2c_progress i2c_go_on(uint8_t *bytes, uint32_t count)
{
    while (asked < count && asked - taken < I2C_FIFO && REG(I2C_STATUS) & I2C_STATUS_TX_NOT_FULL) {
        asked++;
        REG(I2C_DATA_CMD) = I2C_CMD_READ | (asked == count ? I2C_CMD_STOP : 0u);
    }
    while (taken < count && REG(I2C_STATUS) & I2C_STATUS_RX_ANY)
        bytes[taken++] = (uint8_t)REG(I2C_DATA_CMD);
    if (refused())
        return I2C_REFUSED;
    return taken == count ? I2C_DONE : I2C_UNDER_WAY;
}

bool i2c_read(uint8_t *bytes, uint32_t count)
{
    enum i2c_progress progress = I2C_UNDER_WAY;
    if (!wait_idle() || !i2c_start_read())
        return false;
    const uint32_t start_us = now_us();
    while (progress == I2C_UNDER_WAY && now_us() - start_us <= LIMIT_US)
        progress = i2c_go_on(bytes, count);
    return progress == I2C_DONE && wait_idle();
}
