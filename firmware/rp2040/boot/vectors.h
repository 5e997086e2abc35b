/* The exceptions that are handled; all others are faults. */
#ifndef VECTORS_H
#define VECTORS_H

_Noreturn void reset(void);
_Noreturn void fault(void);
void isr_timer0(void);
void isr_io_bank0(void);
void isr_uart0(void);
void isr_usb(void);

#endif
