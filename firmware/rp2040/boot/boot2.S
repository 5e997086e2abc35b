/* Second boot stage. The boot ROM copies these 256 bytes into RAM, checks the CRC that image.py puts into the last
 * four, and runs them: execute-in-place by plain serial reads (command 03h), which every NOR flash understands.
 * Fast enough: flash is read once, by start_reset in start.c. RP2040 data sheet, sections 2.8.1.3 and 4.10. */
    .syntax unified
    .cpu cortex-m0plus
    .thumb

    .equ SSI, 0x18000000
    .equ SSI_CTRLR0, 0x00
    .equ SSI_CTRLR1, 0x04
    .equ SSI_SSIENR, 0x08
    .equ SSI_BAUDR, 0x14
    .equ SSI_SPI_CTRLR0, 0xf4
    .equ CLOCK_DIVIDER, 4                             /* 31 MHz at 125 MHz */
    .equ CTRLR0, 31 << 16 | 3 << 8                    /* frames of 32 bits; send address, receive data */
    .equ SPI_CTRLR0, 0x03 << 24 | 2 << 8 | 6 << 2     /* command 03h of 8 bits, address of 24 bits */
    .equ VECTORS, 0x10000100
    .equ VTOR, 0xe000ed08

    .section .boot2, "ax"
    .global boot2
    .thumb_func
boot2:
    ldr r3, =SSI
    movs r0, #0
    str r0, [r3, #SSI_SSIENR]
    movs r0, #CLOCK_DIVIDER
    str r0, [r3, #SSI_BAUDR]
    ldr r0, =CTRLR0
    str r0, [r3, #SSI_CTRLR0]
    ldr r0, =SPI_CTRLR0
    ldr r1, =SSI + SSI_SPI_CTRLR0
    str r0, [r1]
    movs r0, #0
    str r0, [r3, #SSI_CTRLR1]
    movs r0, #1
    str r0, [r3, #SSI_SSIENR]
    ldr r0, =VECTORS
    ldr r1, =VTOR
    str r0, [r1]
    ldm r0!, {r1, r2}
    msr msp, r1
    bx r2
    .pool
