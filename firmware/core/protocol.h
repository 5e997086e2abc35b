/* Lines in, lines out.
 *
 *     request   >SEQUENCE COMMAND [FIELD ...]*CRC\n
 *     reply     <SEQUENCE BOOT OK [NAME=VALUE ...]*CRC\n
 *               <SEQUENCE BOOT ERR NUMBER*CRC\n       SEQUENCE is ? where the request's could not be read
 *
 * Every line gets exactly one reply, sent from one place; but for one that begins like a reply: it has come back from a
 * line that echoes, and is dropped. The values of the newest reply are kept: the same line again gets it again, without doing anything
 * twice. Up to protocol 2 lines began with the sequence number; ID is still answered in this form, so that an older host
 * can name what it does not understand. */
#ifndef PROTOCOL_H
#define PROTOCOL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "commands.h"

enum { MAX_SEQUENCE = 65535, REQUEST_MARK = '>', REPLY_MARK = '<' };

struct protocol {
    struct generator generator;
    uint32_t boot; /* how often the microcontroller has started */
    enum cause cause;
    char line[MAX_LINE];
    size_t length;
    bool overflow;
    bool answered; /* the next three belong to the newest numbered line */
    uint32_t sequence;
    uint16_t crc;
    struct answer kept;
};

void protocol_boot(struct protocol *protocol, uint32_t boot, enum cause cause);

/* Take one byte from the serial line. ABORT_BYTE switches the light off wherever it stands in the stream, HANG_UP_BYTE
 * trips. */
void protocol_receive(struct protocol *protocol, char byte);

/* To be called all the time by the main loop; generator_idle_us tells how long it may wait. */
void protocol_poll(struct protocol *protocol);

#endif
