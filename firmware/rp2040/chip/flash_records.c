#include "flash_records.h"

#include "flash.h"
#include "rp2040.h"

enum {
    READ = 0x03,
    WRITE_ENABLE = 0x06,
    READ_STATUS = 0x05,
    PROGRAM = 0x02,
    BUSY = 1 << 0,
    FIRST = 0x10000, /* in the flash; image.ld ends before it, and image.py writes it into a file that erases */
    RECORD_BYTES = 4 * STORED_WORDS,
    RECORDS = 64, /* a sector of 4 kB */
    BLANK = 0xffffffff,
    LIMIT_US = 20000, /* a page takes 5 ms at most, W25Q16JV 9.6 */
};

_Static_assert(256 % RECORD_BYTES == 0, "no record crosses a page");

static uint32_t address_of(uint32_t number)
{
    return FIRST + RECORD_BYTES * number;
}

/* False where nothing has been written there. */
static bool read_record(uint32_t number, uint32_t words[STORED_WORDS])
{
    bool written = false;
    flash_begin_at(READ, address_of(number));
    for (uint32_t i = 0; i < STORED_WORDS; i++) {
        words[i] = 0;
        for (uint32_t shift = 0; shift < 32; shift += 8)
            words[i] |= flash_exchange(0) << shift;
        written = written || words[i] != BLANK;
    }
    flash_end();
    return written;
}

/* The first that is blank, or RECORDS; the words are those of the last one that was read. */
static uint32_t find_blank(uint32_t words[STORED_WORDS])
{
    uint32_t number = 0;
    while (number < RECORDS && read_record(number, words))
        number++;
    return number;
}

bool flash_records_read(uint32_t words[STORED_WORDS])
{
    const uint32_t blank = find_blank(words);
    return blank && read_record(blank - 1u, words);
}

static bool is_busy(void)
{
    flash_begin(READ_STATUS);
    const bool busy = flash_exchange(0) & BUSY;
    flash_end();
    return busy;
}

static void program(uint32_t number, const uint32_t words[STORED_WORDS])
{
    flash_begin(WRITE_ENABLE);
    flash_end();
    flash_begin_at(PROGRAM, address_of(number));
    for (uint32_t i = 0; i < RECORD_BYTES; i++)
        (void)flash_exchange(words[i / 4u] >> 8u * (i % 4u) & 0xffu);
    flash_end();
    const uint32_t start_us = REG(TIMER_RAWL);
    while (is_busy() && REG(TIMER_RAWL) - start_us < LIMIT_US)
        ;
}

bool flash_records_append(const uint32_t words[STORED_WORDS])
{
    uint32_t found[STORED_WORDS];
    const uint32_t blank = find_blank(found);
    if (blank == RECORDS)
        return false;
    program(blank, words);
    (void)read_record(blank, found);
    for (uint32_t i = 0; i < STORED_WORDS; i++)
        if (found[i] != words[i])
            return false;
    return true;
}
