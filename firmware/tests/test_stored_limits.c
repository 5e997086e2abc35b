/* The limits that the board keeps over a start. */
#include <string.h>

#include "fake_port.h"
#include "generator.h"
#include "light.h"
#include "safety.h"
#include "shooting.h"

static struct generator generator;

static const struct channel_limits KEPT[CHANNEL_COUNT] = {
    {20000, 100, 300}, {0, 0, 0}, {30000, 200, 500}, {500, 200, 0}};
static const struct channel_limits DARK[CHANNEL_COUNT] = {{0, 0, 0}};
static const struct channel LIGHT_OF_20_A = {0, 20000, 1000, 26400, 1000, 20000, 22000, 23000, false};

static void boot(void)
{
    generator_boot(&generator, CAUSE_POWER);
    fake.now_us += 2 * LONGEST_PERIOD_US; /* 100 ppm */
    safety_heard(&generator);
    generator_poll(&generator);
}

static void store(void)
{
    fake_reset();
    boot();
    CHECK(safety_store_limits(&generator, KEPT) == ERROR_NONE);
}

static bool limits_are(const struct channel_limits *limits)
{
    return !memcmp(generator.limits, limits, sizeof generator.limits);
}

static void test_a_board_without_any_keeps_the_absolute_ones(void)
{
    fake_reset();
    boot();
    const struct channel_limits most = channel_limits_absolute();
    CHECK(generator.stored == STORED_NONE && !generator.faults);
    CHECK(limits_are((struct channel_limits[]){most, most, most, most}));
}

static void test_stored_limits_count_at_once_and_after_every_start(void)
{
    store();
    CHECK(generator.stored == STORED_WHOLE && limits_are(KEPT));
    boot();
    CHECK(generator.stored == STORED_WHOLE && limits_are(KEPT) && generator.state == STATE_SAFE);
    const struct channel above = {0, 20000, 1000, 26400, 1000, 20010, 22000, 23000, false};
    CHECK(safety_set_channel(&generator, 0, &above) == ERROR_LIMIT);
    CHECK(safety_set_channel(&generator, 0, &LIGHT_OF_20_A) == ERROR_NONE);
    CHECK(safety_set_channel(&generator, 1, &LIGHT_OF_20_A) == ERROR_LIMIT);
    CHECK(light_start(&generator, 1000, (uint32_t[]){310, 0, 0, 0}) == ERROR_LIMIT);
}

static void test_the_host_can_only_tighten_stored_limits(void)
{
    store();
    CHECK(!safety_tighten(&generator, 0, &(struct channel_limits){30000, 200, 500}) && limits_are(KEPT));
    CHECK(!safety_tighten(&generator, 0, &(struct channel_limits){10000, 50, 0}));
    CHECK(generator.limits[0].max_current_ma == 10000 && generator.limits[0].max_duty_ppm == 50);
    boot();
    CHECK(limits_are(KEPT));
}

static void test_nothing_above_the_absolute_limits_is_stored(void)
{
    store();
    for (int field = 0; field < 3; field++) {
        struct channel_limits asked[CHANNEL_COUNT] = {{0, 0, 0}};
        asked[3] = channel_limits_absolute();
        CHECK(!safety_store_limits(&generator, asked));
        asked[3].max_current_ma += field == 0;
        asked[3].max_duty_ppm += field == 1;
        asked[3].max_light_ma += field == 2;
        CHECK(safety_store_limits(&generator, asked) == ERROR_STORE);
    }
}

static void arm(void)
{
    fake.now_us += 2 * LONGEST_PERIOD_US;
    CHECK(!safety_new_train(&generator) && !safety_set_channel(&generator, 0, &LIGHT_OF_20_A));
    CHECK(!safety_load(&generator) && !shooting_arm(&generator, 1, SOURCE_COMMAND, 0));
}

static void test_nothing_is_stored_while_there_can_be_light(void)
{
    store();
    fake.any_stored = false;
    arm();
    CHECK(safety_store_limits(&generator, KEPT) == ERROR_NOT_SAFE && !fake.any_stored);
    CHECK(!shooting_fire(&generator) && generator.state == STATE_SAFE && generator.outputs_live);
    CHECK(safety_store_limits(&generator, KEPT) == ERROR_EARLY && !fake.any_stored && fake.live);
    boot();
    CHECK(!light_start(&generator, 1000, (uint32_t[]){100, 0, 0, 0}));
    CHECK(safety_store_limits(&generator, KEPT) == ERROR_NOT_SAFE && !fake.any_stored);
}

static void test_a_loaded_train_does_not_survive_other_limits(void)
{
    store();
    CHECK(!safety_set_channel(&generator, 0, &LIGHT_OF_20_A) && !safety_load(&generator));
    CHECK(!safety_store_limits(&generator, KEPT));
    CHECK(shooting_arm(&generator, 1, SOURCE_COMMAND, 0) == ERROR_NO_TRAIN);
}

/* Of the channel with the least: nobody knows which light was before. */
static void test_a_start_waits_as_long_as_the_stored_duty_demands(void)
{
    const struct channel_limits slow[CHANNEL_COUNT] = {{20000, 10, 0}, {0, 0, 0}, {30000, 200, 500}, {500, 3, 0}};
    store();
    CHECK(!safety_store_limits(&generator, slow));
    arm();
    CHECK(shooting_fire(&generator) == ERROR_EARLY); /* nor did the limits before it tell */
    boot();
    arm();
    fake.now_us = generator.not_before_us - 1;
    CHECK(shooting_fire(&generator) == ERROR_EARLY);
    fake.now_us++;
    CHECK(!shooting_fire(&generator));
    const uint64_t shot_us = fake.now_us;
    boot();
    CHECK(generator.not_before_us == shot_us + 1333334); /* 4 us at 3 ppm, and not a microsecond less */
    store();
    fake.now_us += 2 * LONGEST_PERIOD_US;
    CHECK(light_start(&generator, 1000, (uint32_t[]){100, 0, 0, 0}) == ERROR_NONE);
    safety_off(&generator);
    CHECK(generator.not_before_us == fake.now_us + 40000);
}

static void test_a_store_does_not_shorten_the_wait_after_a_shot(void)
{
    store();
    fake.now_us += 2 * LONGEST_PERIOD_US;
    CHECK(!safety_tighten(&generator, 0, &(struct channel_limits){UINT32_MAX, 1, UINT32_MAX}));
    arm();
    CHECK(!shooting_fire(&generator));
    safety_off(&generator);
    const uint64_t not_before_us = generator.not_before_us;
    CHECK(!safety_store_limits(&generator, KEPT));
    CHECK(generator.not_before_us == not_before_us);
}

/* The sum of such a record is right: that of a firmware with other limits. */
static void test_limits_beyond_the_absolute_ones_are_damaged(void)
{
    for (int field = 0; field < 3 * CHANNEL_COUNT; field++) {
        uint32_t limits[3 * CHANNEL_COUNT] = {0};
        limits[field] = (const uint32_t[]){30000, 200, 500}[field % 3];
        for (int beyond = 0; beyond < 2; beyond++, limits[field]++) {
            fake_reset();
            stored_limits_write((const struct channel_limits *)limits);
            boot();
            CHECK(generator.faults == (beyond ? FAULT_LIMITS : 0));
            CHECK(limits_are(beyond ? DARK : (const struct channel_limits *)limits));
        }
    }
}

static void test_limits_that_are_stored_already_need_no_room(void)
{
    store();
    fake.store_is_full = true;
    CHECK(!safety_store_limits(&generator, KEPT) && limits_are(KEPT));
}

/* Whichever word it is. */
static void test_a_flipped_bit_is_no_light_until_others_are_stored(void)
{
    for (int word = 0; word < STORED_WORDS - 2; word++) {
        store();
        fake.stored[word] ^= 1u << word;
        boot();
        CHECK(generator.stored == STORED_DAMAGED && generator.state == STATE_FAULT);
        CHECK(generator.faults == FAULT_LIMITS && limits_are(DARK));
        CHECK(safety_clear(&generator) == ERROR_HARDWARE && generator.state == STATE_FAULT);
        CHECK(!safety_store_limits(&generator, KEPT) && generator.state == STATE_FAULT);
        CHECK(!safety_clear(&generator) && generator.state == STATE_SAFE && limits_are(KEPT));
    }
}

/* What a power cut leaves: the first bytes, or all but one bit that should have become 0. Two words are unused. */
static void test_what_is_half_written_is_no_light(void)
{
    uint8_t whole[sizeof fake.stored];
    store();
    memcpy(whole, fake.stored, sizeof whole);
    for (size_t written = 1; written < sizeof whole; written++) {
        memset((uint8_t *)fake.stored + written, 0xff, sizeof whole - written);
        boot();
        CHECK(generator.faults == (written < sizeof whole - 8 ? FAULT_LIMITS : 0));
        memcpy(fake.stored, whole, sizeof whole);
    }
    for (size_t bit = 0; bit < 8 * (sizeof whole - 8); bit++) {
        if (whole[bit / 8] >> bit % 8 & 1)
            continue;
        ((uint8_t *)fake.stored)[bit / 8] ^= (uint8_t)(1u << bit % 8);
        boot();
        CHECK(generator.faults == FAULT_LIMITS && limits_are(DARK));
        memcpy(fake.stored, whole, sizeof whole);
    }
}

static void test_damaged_limits_are_named_beside_a_restart_by_the_watchdog(void)
{
    store();
    fake.stored[3] ^= 1u;
    generator_boot(&generator, CAUSE_WATCHDOG);
    CHECK(generator.faults == (FAULT_LIMITS | FAULT_WATCHDOG));
}

static void test_words_of_another_kind_are_damaged_limits(void)
{
    fake_reset();
    fake.any_stored = true; /* all zero: the sum of nothing */
    boot();
    CHECK(generator.stored == STORED_DAMAGED && generator.faults == FAULT_LIMITS);
}

static void test_what_is_not_stored_is_said_and_the_old_limits_stay(void)
{
    store();
    fake.store_is_full = true;
    CHECK(safety_store_limits(&generator, (struct channel_limits[CHANNEL_COUNT]){{10, 1, 0}}) == ERROR_HARDWARE);
    CHECK(generator.state == STATE_SAFE && limits_are(KEPT));
    fake.store_is_full = false;
    fake.store_damages = true;
    CHECK(safety_store_limits(&generator, KEPT) == ERROR_HARDWARE);
    CHECK(generator.stored == STORED_DAMAGED && generator.faults == FAULT_LIMITS);
}

static void test_limits_that_changed_in_memory_are_not_stored_away(void)
{
    store();
    generator.limits[0].max_current_ma ^= 1u << 3;
    CHECK(safety_store_limits(&generator, KEPT) == ERROR_FAULT_LATCHED && generator.faults == FAULT_INTERNAL);
    CHECK(safety_clear(&generator) == ERROR_HARDWARE);
}

int main(void)
{
    test_a_board_without_any_keeps_the_absolute_ones();
    test_stored_limits_count_at_once_and_after_every_start();
    test_the_host_can_only_tighten_stored_limits();
    test_nothing_above_the_absolute_limits_is_stored();
    test_nothing_is_stored_while_there_can_be_light();
    test_a_loaded_train_does_not_survive_other_limits();
    test_a_start_waits_as_long_as_the_stored_duty_demands();
    test_a_store_does_not_shorten_the_wait_after_a_shot();
    test_limits_beyond_the_absolute_ones_are_damaged();
    test_limits_that_are_stored_already_need_no_room();
    test_a_flipped_bit_is_no_light_until_others_are_stored();
    test_what_is_half_written_is_no_light();
    test_damaged_limits_are_named_beside_a_restart_by_the_watchdog();
    test_words_of_another_kind_are_damaged_limits();
    test_what_is_not_stored_is_said_and_the_old_limits_stay();
    test_limits_that_changed_in_memory_are_not_stored_away();
    return 0;
}
