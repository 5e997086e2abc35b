/* Vector tables: the one that the second boot stage starts from, and the one in RAM. */
    .section .flash_vectors, "a"
    .word stack_top
    .word reset

    .section .vectors, "a"
    .word stack_top
    .word reset
    .rept 14
    .word fault
    .endr
    .word isr_timer0                                  /* interrupt 0 */
    .rept 4
    .word fault
    .endr
    .word isr_usb                                     /* 5 */
    .rept 7
    .word fault
    .endr
    .word isr_io_bank0                                /* 13 */
    .rept 6
    .word fault
    .endr
    .word isr_uart0                                   /* 20 */
    .rept 11
    .word fault
    .endr

/* An image has one of these two; the other one would be a fault. */
    .syntax unified
    .cpu cortex-m0plus
    .thumb
    .section .text.absent, "ax"
    .weak isr_usb
    .weak isr_uart0
    .thumb_func
isr_usb:
    .thumb_func
isr_uart0:
    bl fault
