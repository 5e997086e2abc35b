#include "identity.h"

#include <stdbool.h>
#include <stdint.h>

#include "rp2040.h"

enum {
    READ_UNIQUE_ID = 0x4b, /* of every flash that the boot ROM can start from; four bytes later come 64 bits */
    DUMMY_BYTES = 5,       /* the command among them */
    ID_BYTES = 8,
    CLOCK_DIVIDER = 8, /* 15.6 MHz at 125 MHz */
    POLLS = 1000,      /* a byte takes 64 cycles */
};

/* The RP2040 has no number of its own; its flash has one. */
static char serial[2 * ID_BYTES + 1];

_Static_assert(sizeof serial == 17, "16 characters");

static uint32_t exchange(uint32_t byte)
{
    REG(SSI_DR0) = byte;
    for (int i = 0; i < POLLS && !(REG(SSI_SR) & SSI_SR_RX_ANY); i++)
        ;
    return REG(SSI_DR0) & 0xffu;
}

static void start_plain_transfers(void)
{
    REG(SSI_SSIENR) = 0;
    REG(SSI_CTRLR0) = SSI_CTRLR0_BYTES_BOTH_WAYS;
    REG(SSI_BAUDR) = CLOCK_DIVIDER;
    REG(SSI_SER) = 1;
    REG(SSI_SSIENR) = 1;
}

static void read_unique_id(uint8_t id[ID_BYTES])
{
    REG(IO_QSPI_SS_CTRL) = OUTPUT_LOW;
    (void)exchange(READ_UNIQUE_ID);
    for (int i = 1; i < DUMMY_BYTES; i++)
        (void)exchange(0);
    for (int i = 0; i < ID_BYTES; i++)
        id[i] = (uint8_t)exchange(0);
    REG(IO_QSPI_SS_CTRL) = OUTPUT_HIGH;
}

/* A flash without a number leaves the line high or low. */
static bool is_number(const uint8_t id[ID_BYTES])
{
    for (int i = 0; i < ID_BYTES; i++)
        if (id[i] != 0x00 && id[i] != 0xff)
            return true;
    return false;
}

void identity_read_board(void)
{
    static const char DIGITS[] = "0123456789ABCDEF";
    uint8_t id[ID_BYTES];
    start_plain_transfers();
    read_unique_id(id);
    if (!is_number(id))
        return;
    for (int i = 0; i < ID_BYTES; i++) {
        serial[2 * i] = DIGITS[id[i] >> 4];
        serial[2 * i + 1] = DIGITS[id[i] & 15];
    }
    serial[2 * ID_BYTES] = '\0';
}

const char *identity_serial(void)
{
    return serial[0] ? serial : "unknown";
}
