/* The limits of the LEDs that the board keeps over a start, so that no rig file can raise them. A record is written behind
 * the one before and none is ever erased: what ends in the middle is a damaged record, and no light. */
#ifndef STORED_LIMITS_H
#define STORED_LIMITS_H

#include "channel_limits.h"

enum stored {
    STORED_NONE = 0,    /* nothing has ever been stored: the absolute limits */
    STORED_WHOLE = 1,   /* as they were stored */
    STORED_DAMAGED = 2, /* they do not read as they were stored: no light on any channel */
};

/* Of all channels; for both. */
enum stored stored_limits_read(struct channel_limits *limits);

/* Whether it was written, reading tells. */
void stored_limits_write(const struct channel_limits *limits);

#endif
