#include "flash_records.h"

#include "flash.h"
#include "rp2040.h"

enum {
    READ = 0x03,
    WRITE_ENABLE = 0x06,
    READ_STATUS = 0x05,
    PROGRAM = 0x02,
    BUSY = 1 << 0,
    BOOT_STAGE = 0,  /* in the flash; never blank */
    FIRST = 0x10000, /* image.ld ends before it, and image.py writes it into a file that erases */
    END = FIRST + 4096,
    RECORD_BYTES = 4 * STORED_WORDS,
    BLANK = 0xffffffff,
    LOOKS = 2,
    LIMIT_US = 20000, /* a page takes 5 ms at most, W25Q16JV 9.6 */
};

_Static_assert(256 % RECORD_BYTES == 0, "no record crosses a page");

/* False where nothing has been written there. */
static bool read_record(uint32_t address, uint32_t words[STORED_WORDS])
{
    uint32_t common = BLANK; /* of all words: their ones */
    flash_begin_at(READ, address);
    for (uint32_t i = 0; i < STORED_WORDS; i++) {
        uint32_t word = 0;
        for (uint32_t shift = 0; shift < 32; shift += 8)
            word |= flash_exchange(0) << shift;
        words[i] = word;
        common &= word;
    }
    flash_end();
    return common != BLANK;
}

/* The first that is blank, at a second look too, or END. A flash that is gone, or still busy, leaves the line high, and
 * everything in it seems blank: its boot stage too, which is read after each look. Then nothing in it is taken for blank. */
static uint32_t find_blank(uint32_t words[STORED_WORDS])
{
    uint32_t address = FIRST;
    for (int looks = 0; looks < (int)LOOKS && address < END; looks++) {
        if (read_record(address, words)) {
            address += RECORD_BYTES;
            looks = -1;
        } else if (!read_record(BOOT_STAGE, words)) {
            return END;
        }
    }
    return address;
}

bool flash_records_read(uint32_t words[STORED_WORDS])
{
    const uint32_t newest = find_blank(words) - RECORD_BYTES;
    (void)read_record(newest, words);
    return newest >= FIRST;
}

static bool is_busy(void)
{
    flash_begin(READ_STATUS);
    const bool busy = flash_exchange(0) & BUSY;
    flash_end();
    return busy;
}

static void program(uint32_t address, const uint32_t words[STORED_WORDS])
{
    flash_begin(WRITE_ENABLE);
    flash_end();
    flash_begin_at(PROGRAM, address);
    for (uint32_t i = 0; i < STORED_WORDS; i++)
        for (uint32_t shift = 0; shift < 32; shift += 8)
            (void)flash_exchange(words[i] >> shift & 0xffu);
    flash_end();
    const uint32_t start_us = REG(TIMER_RAWL);
    while (is_busy() && REG(TIMER_RAWL) - start_us < LIMIT_US)
        ;
}

void flash_records_append(const uint32_t words[STORED_WORDS])
{
    uint32_t found[STORED_WORDS];
    const uint32_t blank = find_blank(found);
    if (blank < END)
        program(blank, words);
}
