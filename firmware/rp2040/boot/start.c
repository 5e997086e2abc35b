/* From the second boot stage to main: copy the image into RAM, where all of it runs; flash is not read again. */
#include <stdint.h>

#include "outputs.h"
#include "rp2040.h"
#include "vectors.h"

/* From image.ld. */
extern uint32_t flash_copy[];
extern uint32_t image_start[];
extern uint32_t image_end[];
extern uint32_t bss_start[];
extern uint32_t bss_end[];

int main(void);

__attribute__((section(".flash_text"))) void reset(void)
{
    __asm__ volatile("cpsid i" ::: "memory");
    const volatile uint32_t *from = flash_copy;
    for (volatile uint32_t *to = image_start; to < image_end; to++)
        *to = *from++;
    for (volatile uint32_t *word = bss_start; word < bss_end; word++)
        *word = 0;
    REG(SCB_VTOR) = (uint32_t)(uintptr_t)image_start; /* vectors.S comes first */
    (void)main();
    fault();
}

/* Dark first; then the watchdog restarts the chip. */
void fault(void)
{
    __asm__ volatile("cpsid i" ::: "memory");
    outputs_off();
    for (;;)
        ;
}
