#include "stored_limits.h"

#include "port.h"
#include "sum.h"

enum { MARK = 0x4c494d31 };

struct record {
    uint32_t mark;
    struct channel_limits limits[CHANNEL_COUNT];
    uint32_t sum; /* of all before it */
    uint32_t unused[2];
};

_Static_assert(sizeof(struct record) == STORED_WORDS * sizeof(uint32_t), "words alone");

static uint32_t sum_of_record(const struct record *record)
{
    return sum_of(record, sizeof *record - sizeof record->unused - sizeof record->sum);
}

enum stored stored_limits_read(struct channel_limits *limits)
{
    struct record record;
    const bool any = port_read_stored((uint32_t *)&record);
    const bool whole = any && record.mark == MARK && record.sum == sum_of_record(&record);
    const struct channel_limits most = channel_limits_absolute();
    const struct channel_limits none = {0};
    for (int i = 0; i < CHANNEL_COUNT; i++)
        limits[i] = whole ? record.limits[i] : any ? none : most;
    return whole ? STORED_WHOLE : any ? STORED_DAMAGED : STORED_NONE;
}

bool stored_limits_write(const struct channel_limits *limits)
{
    struct record record = {.mark = MARK};
    for (int i = 0; i < CHANNEL_COUNT; i++)
        record.limits[i] = limits[i];
    record.sum = sum_of_record(&record);
    return port_store((const uint32_t *)&record);
}
