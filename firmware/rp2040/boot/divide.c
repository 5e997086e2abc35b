/* What the compiler itself calls to divide, by the divider of the chip, section 2.3.1.5. It has one, and an interrupt might
 * divide too. */
#include <stdint.h>

#include "rp2040.h"

uint32_t __aeabi_uidiv(uint32_t dividend, uint32_t divisor);
uint64_t __aeabi_uidivmod(uint32_t dividend, uint32_t divisor);

uint64_t __aeabi_uidivmod(uint32_t dividend, uint32_t divisor)
{
    const uint32_t before = interrupts_mask();
    REG(SIO_DIV_UDIVIDEND) = dividend;
    REG(SIO_DIV_UDIVISOR) = divisor;
    while (!(REG(SIO_DIV_CSR) & SIO_DIV_READY))
        ;
    const uint32_t remainder = REG(SIO_DIV_REMAINDER);
    const uint32_t quotient = REG(SIO_DIV_QUOTIENT);
    interrupts_restore(before);
    return (uint64_t)remainder << 32 | quotient;
}

uint32_t __aeabi_uidiv(uint32_t dividend, uint32_t divisor)
{
    return (uint32_t)__aeabi_uidivmod(dividend, divisor);
}
