/* From the second boot stage to main: copy the image into RAM, where all of it runs; flash is not read again. */
#include <stdint.h>

#include "outputs.h"
#include "rp2040.h"

/* From image.ld. */
extern uint32_t flash_copy[];
extern uint32_t image_start[];
extern uint32_t image_end[];
extern uint32_t bss_start[];
extern uint32_t bss_end[];

int main(void);

/* For vectors.S. */
_Noreturn void start_reset(void);
_Noreturn void start_fault(void);

__attribute__((section(".flash_text"))) void start_reset(void)
{
    __asm__ volatile("cpsid i" ::: "memory");
    const volatile uint32_t *from = flash_copy;
    for (volatile uint32_t *to = image_start; to < image_end; to++)
        *to = *from++;
    for (volatile uint32_t *word = bss_start; word < bss_end; word++)
        *word = 0;
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
