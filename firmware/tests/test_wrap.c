/* Across the time at which 32 bits of microseconds wrap, 71 minutes after the start: everything at its time. */
#include "fake_port.h"
#include "generator.h"
#include "light.h"
#include "safety.h"
#include "shooting.h"

enum { PERIOD_US = 100000 };

static struct generator generator;

static const struct channel LEGAL = {
    .a_start_ns = 20000,
    .a_width_ns = 1000,
    .b_start_ns = 26400,
    .b_width_ns = 1000,
    .current_ma = 20000,
    .frame_a_close_ns = 22000,
    .frame_b_open_ns = 23000,
};

static void wait_us(uint32_t time_us)
{
    fake.now_us += time_us;
    generator_poll(&generator);
}

/* Loaded, quiet, and heard, so long before the wrap. */
static void boot_before(uint32_t time_us)
{
    fake_reset();
    generator_boot(&generator, CAUSE_POWER);
    CHECK(!safety_set_channel(&generator, 0, &LEGAL) && !safety_load(&generator));
    fake.now_us = (1ull << 32) - time_us;
    safety_heard(&generator);
    generator_poll(&generator);
}

static void arm(enum source source)
{
    CHECK(!shooting_arm(&generator, 99, source, source == SOURCE_TIMER ? PERIOD_US : 0));
    generator_poll(&generator);
}

/* Of every source, and of continuous light; it begins before the wrap or behind it. */
static void test_silence_is_counted_over_the_wrap(void)
{
    const uint32_t current_ma[CHANNEL_COUNT] = {100, 0, 0, 0};
    for (uint32_t source = SOURCE_COMMAND; source <= SOURCE_TIMER + 1; source++) {
        for (uint32_t before_us = 1; before_us < 4000000; before_us += 500000) {
            boot_before(before_us);
            if (source > SOURCE_TIMER)
                CHECK(!light_start(&generator, 60000, current_ma));
            else
                arm((enum source)source);
            for (int i = 0; i < 30; i++) {
                wait_us(HEARTBEAT_MS * 1000u / 30u - FIRING_US);
                CHECK(generator.state == (source > SOURCE_TIMER ? STATE_LIT : STATE_ARMED));
            }
            wait_us(31 * FIRING_US);
            CHECK(generator.faults == FAULT_HEARTBEAT && !fake.live);
        }
    }
}

static void test_the_period_is_kept_over_the_wrap(void)
{
    for (uint32_t before_us = 1; before_us < 2 * MIN_PERIOD_US; before_us += 1999) {
        boot_before(before_us);
        arm(SOURCE_COMMAND);
        CHECK(shooting_fire(&generator) == ERROR_NONE);
        for (uint32_t waited_us = 999; waited_us < MIN_PERIOD_US; waited_us += 999) {
            wait_us(999);
            CHECK(shooting_fire(&generator) == ERROR_EARLY);
        }
        wait_us(10);
        CHECK(shooting_fire(&generator) == ERROR_NONE && fake.fired == 2);
    }
}

static void test_the_timer_fires_at_its_time_over_the_wrap(void)
{
    for (uint32_t before_us = 1; before_us < 3 * PERIOD_US; before_us += 49999) {
        boot_before(before_us);
        arm(SOURCE_TIMER);
        uint64_t due_us = fake.now_us + PERIOD_US;
        for (unsigned shot = 0; shot < 4; shot++) {
            for (; fake.now_us < due_us; fake.now_us += 100) {
                generator_poll(&generator);
                CHECK(fake.fired == shot && generator_idle_us(&generator) > 0);
            }
            fake.now_us = due_us;
            generator_poll(&generator);
            CHECK(fake.fired == shot + 1);
            due_us += PERIOD_US;
        }
    }
}

static void test_continuous_light_ends_at_its_time_over_the_wrap(void)
{
    const uint32_t current_ma[CHANNEL_COUNT] = {100, 0, 0, 0};
    for (uint32_t before_us = 1; before_us < 2000000; before_us += 300000) {
        boot_before(before_us);
        CHECK(!light_start(&generator, 1000, current_ma));
        for (int ms = 0; ms < 999; ms++) {
            wait_us(1000);
            CHECK(generator.state == STATE_LIT);
        }
        wait_us(1000);
        CHECK(generator.state == STATE_SAFE && !fake.live);
    }
}

static void test_set_points_settle_over_the_wrap(void)
{
    const uint32_t current_ma[CHANNEL_COUNT] = {100, 0, 0, 0};
    for (uint32_t before_us = 1; before_us < 2 * SETTLE_MS * 1000u; before_us += 3999) {
        boot_before(before_us);
        arm(SOURCE_COMMAND);
        safety_off(&generator);
        for (int ms = 1; ms < SETTLE_MS; ms++) {
            wait_us(1000);
            CHECK(light_start(&generator, 1000, current_ma) == ERROR_EARLY);
        }
        wait_us(1000);
        CHECK(light_start(&generator, 1000, current_ma) == ERROR_NONE);
    }
}

static void test_the_last_train_ends_over_the_wrap(void)
{
    for (uint32_t before_us = 1; before_us < 60; before_us++) {
        boot_before(before_us);
        CHECK(!shooting_arm(&generator, 1, SOURCE_COMMAND, 0) && !shooting_fire(&generator));
        for (int us = 0; us < 28; us++) {
            wait_us(1);
            CHECK(fake.live && generator.shot_lights);
        }
        wait_us(1);
        CHECK(!fake.live && !generator.shot_lights && generator.state == STATE_SAFE);
    }
}

int main(void)
{
    test_silence_is_counted_over_the_wrap();
    test_the_period_is_kept_over_the_wrap();
    test_the_timer_fires_at_its_time_over_the_wrap();
    test_continuous_light_ends_at_its_time_over_the_wrap();
    test_set_points_settle_over_the_wrap();
    test_the_last_train_ends_over_the_wrap();
    return 0;
}
