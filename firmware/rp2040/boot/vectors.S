/* Vector tables: the one that the second boot stage starts from, and the one in RAM. */
    .section .flash_vectors, "a"
    .word stack_top
    .word start_reset
    .word flash_copy                                  /* for image.py */

    .section .vectors, "a"
    .word stack_top
    .word start_reset
    .rept 13
    .word start_fault
    .endr
    .word clock_check_isr                             /* SysTick */
    .word timer_isr                                   /* interrupt 0 */
    .rept 4
    .word start_fault
    .endr
    .word serial_usb_isr                              /* 5 */
    .rept 7
    .word start_fault
    .endr
    .word interlock_isr                               /* 13: pins */
    .rept 6
    .word start_fault
    .endr
    .word serial_uart_isr                             /* 20 */
    .rept 11
    .word start_fault
    .endr

/* An image has one of these two; the other one would be a fault. */
    .syntax unified
    .cpu cortex-m0plus
    .thumb
    .section .text.absent, "ax"
    .weak serial_usb_isr
    .weak serial_uart_isr
    .thumb_func
serial_usb_isr:
    .thumb_func
serial_uart_isr:
    bl start_fault
