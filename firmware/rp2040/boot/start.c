/* From the second boot stage to main: copy the image into RAM, where all of it runs; flash is not read again. An image
 * that is not what image.py has summed up is not run: after a reset the pads pull down, which is dark. */
#include <stdint.h>

#include "checksum.h"
#include "outputs.h"
#include "rp2040.h"

/* From image.ld. */
extern uint32_t flash_start[];
extern uint32_t flash_sum[];
extern uint32_t flash_copy[];
extern uint32_t image_start[];
extern uint32_t image_sum[];
extern uint32_t stack_top[];
extern uint32_t bss_start[];
extern uint32_t bss_end[];

int main(void);

/* For vectors.S. */
_Noreturn void start_reset(void);
_Noreturn void start_fault(void);

static inline void clear(volatile uint32_t *from, const volatile uint32_t *end)
{
    while (from < end)
        *from++ = 0;
}

ONCE void start_reset(void)
{
    __asm__ volatile("cpsid i" ::: "memory");
    const volatile uint32_t *from = flash_copy;
    uint32_t sum = CHECKSUM_START;
    for (volatile uint32_t *to = image_start; to < image_sum; to++) {
        const uint32_t word = *from++;
        *to = word;
        sum = sum_on(sum, word);
    }
    *(volatile uint32_t *)image_sum = *from;
    if (sum != *from || checksum_words(flash_start, flash_sum) != *flash_sum)
        for (;;)
            __asm__ volatile("wfi");
    clear(stack_top, image_start);
    clear(bss_start, bss_end);
    REG(SCB_VTOR) = (uint32_t)(uintptr_t)image_start; /* vectors.S comes first */
    (void)main();
    start_fault();
}

/* Dark first; then the watchdog restarts the chip. */
void start_fault(void)
{
    __asm__ volatile("cpsid i" ::: "memory");
    outputs_off();
    for (;;)
        ;
}
