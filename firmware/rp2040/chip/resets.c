#include "resets.h"

#include "rp2040.h"

void resets_restart(uint32_t reset_bits)
{
    REG_SET(RESETS_RESET) = reset_bits;
    REG_CLEAR(RESETS_RESET) = reset_bits;
    while ((REG(RESETS_DONE) & reset_bits) != reset_bits)
        ;
}
