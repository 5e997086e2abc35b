/* Which pin does what; docs/firmware/wiring.md has the same table, and a test compares the two. */
#ifndef PINS_H
#define PINS_H

enum pins {
    PIN_UART_TX = 0,
    PIN_UART_RX = 1,
    PIN_LIGHT = 2,      /* to 5: light of channel 0 to 3, high is on */
    PIN_CAMERA = 6,     /* to 9: camera trigger of channel 0 to 3, rising edge */
    PIN_TRIGGER = 11,   /* starts all state machines: from inside, or by its rising edge when armed for that */
    PIN_INTERLOCK = 12, /* high while the interlock chain is closed */
    PIN_ESTOP = 13,     /* high while the emergency stop is closed */
    PIN_SET_POINT = 16, /* to 19: PWM of the current set-point of channel 0 to 3, on a board without converter */
    PIN_I2C_SDA = 20,   /* converter of the current set-points */
    PIN_I2C_SCL = 21,
};

#endif
