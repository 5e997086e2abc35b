#include "supply.h"

#include "rp2040.h"

enum {
    ENABLE = 1 << 0,
    /* Section 2.10.7. After a reset it is 0.860 V; the regulator gives 1.10 V, 3 % less at worst, and the detector is 3 %
     * off at worst: 0.974 V is below 1.067 V. */
    BELOW_946_MV = 11 << 4,
};

ONCE void supply_start(void)
{
    REG(BROWN_OUT) = ENABLE | BELOW_946_MV;
    while ((REG(BROWN_OUT) & (ENABLE | 15u << 4)) != (ENABLE | BELOW_946_MV))
        ;
}
