#include "identity.h"

#include <stdbool.h>
#include <stdint.h>

#include "flash.h"

enum {
    READ_UNIQUE_ID = 0x4b, /* of every flash that the boot ROM can start from; four bytes later come 64 bits */
    ID_BYTES = 8,
};

/* The RP2040 has no number of its own; its flash has one. */
static char serial[2 * ID_BYTES + 1];

_Static_assert(sizeof serial == 17, "16 characters");

/* A flash without a number leaves the line high or low. */
void identity_read_board(void)
{
    static const char DIGITS[] = "0123456789ABCDEF";
    bool is_number = false;
    flash_begin_at(READ_UNIQUE_ID, 0);
    (void)flash_exchange(0);
    for (int i = 0; i < 2 * ID_BYTES; i += 2) {
        const uint32_t byte = flash_exchange(0);
        is_number = is_number || (byte != 0x00 && byte != 0xff);
        serial[i] = DIGITS[byte >> 4];
        serial[i + 1] = DIGITS[byte & 15u];
    }
    flash_end();
    if (!is_number)
        serial[0] = '\0';
}

const char *identity_serial(void)
{
    return serial[0] ? serial : "unknown";
}
