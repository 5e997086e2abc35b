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
    enum stored found = STORED_NONE;
    if (port_read_stored((uint32_t *)&record))
        found = record.mark == MARK && record.sum == sum_of_record(&record) &&
                        channel_limits_are_within_absolute(record.limits)
                    ? STORED_WHOLE
                    : STORED_DAMAGED;
    if (found == STORED_DAMAGED)
        record = (struct record){0};
    for (int i = 0; i < CHANNEL_COUNT; i++)
        limits[i] = found == STORED_NONE ? channel_limits_absolute() : record.limits[i];
    return found;
}

void stored_limits_write(const struct channel_limits *limits)
{
    struct record record = {.mark = MARK};
    for (int i = 0; i < CHANNEL_COUNT; i++)
        record.limits[i] = limits[i];
    record.sum = sum_of_record(&record);
    port_store((const uint32_t *)&record);
}
