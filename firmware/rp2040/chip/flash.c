#include "flash.h"

#include "rp2040.h"

enum {
    CLOCK_DIVIDER = 8, /* 15.6 MHz at 125 MHz */
    POLLS = 1000,      /* a byte takes 64 cycles */
};

void flash_take_over(void)
{
    REG(SSI_SSIENR) = 0;
    REG(SSI_CTRLR0) = SSI_CTRLR0_BYTES_BOTH_WAYS;
    REG(SSI_BAUDR) = CLOCK_DIVIDER;
    REG(SSI_SER) = 1;
    REG(SSI_SSIENR) = 1;
}

uint32_t flash_exchange(uint32_t byte)
{
    REG(SSI_DR0) = byte;
    for (int i = 0; i < POLLS && !(REG(SSI_SR) & SSI_SR_RX_ANY); i++)
        ;
    return REG(SSI_DR0) & 0xffu;
}

void flash_begin(uint32_t command)
{
    REG(IO_QSPI_SS_CTRL) = OUTPUT_LOW;
    (void)flash_exchange(command);
}

void flash_begin_at(uint32_t command, uint32_t address)
{
    flash_begin(command);
    for (int shift = 16; shift >= 0; shift -= 8)
        (void)flash_exchange(address >> shift & 0xffu);
}

void flash_end(void)
{
    REG(IO_QSPI_SS_CTRL) = OUTPUT_HIGH;
}
