/* Numbered errors: the only words in which the generator says no. Listed in firmware/README.md. */
#ifndef ERROR_H
#define ERROR_H

enum error {
    ERROR_NONE = 0,
    ERROR_CRC = 1,
    ERROR_LINE_TOO_LONG = 2,
    ERROR_UNKNOWN_COMMAND = 3,
    ERROR_SYNTAX = 4,
    ERROR_SEQUENCE = 5,
    ERROR_NOT_SAFE = 6,
    ERROR_NOT_ARMED = 7,
    ERROR_FAULT_LATCHED = 8,
    ERROR_INTERLOCK_OPEN = 9,
    ERROR_EARLY = 10,
    ERROR_NO_TRAIN = 11,
    ERROR_CHANNEL = 12,
    ERROR_WIDTH = 13,
    ERROR_SEPARATION = 14,
    ERROR_EDGE = 15,
    ERROR_CURRENT = 16,
    ERROR_STRADDLE = 17,
    ERROR_SHOTS = 18,
    ERROR_HARDWARE = 19,
    ERROR_LIMIT = 20,
    ERROR_LIGHT = 21,
    ERROR_ESTOP_OPEN = 22,
    ERROR_SOURCE = 23,
    ERROR_PERIOD = 24,
    ERROR_OTHER_SOURCE = 25,
    ERROR_NO_SHOT = 26,
    ERROR_STORE = 27,
};

#endif
