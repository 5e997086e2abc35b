#include "image_check.h"

#include <stdint.h>

#include "checksum.h"

enum { WORDS_PER_LOOK = 4 }; /* a round takes less than two seconds */

/* From image.ld. */
extern uint32_t image_start[];
extern uint32_t image_sum[];

static const uint32_t *next; /* word to be looked at; null before the first round */
static uint32_t sum;
static bool damaged;

static void start_round(void)
{
    next = image_start;
    sum = CHECKSUM_START;
}

void image_check_poll(void)
{
    if (!next)
        start_round();
    const uint32_t *const end = image_sum - next > WORDS_PER_LOOK ? next + WORDS_PER_LOOK : image_sum;
    sum = checksum_on(sum, next, end);
    next = end;
    if (end < image_sum)
        return;
    damaged = damaged || sum != *end;
    start_round();
}

bool image_check_intact(void)
{
    return !damaged;
}
