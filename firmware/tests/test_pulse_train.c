/* Limits and quantisation of the pulse train, at and beyond every bound. */
#include "channel_limits.h"
#include "fake_port.h"
#include "pulse_train.h"

static const struct channel LEGAL = {
    .camera_ns = 1000,
    .a_start_ns = 20000,
    .a_width_ns = 1000,
    .b_start_ns = 26400,
    .b_width_ns = 1000,
    .current_ma = 20000,
    .frame_a_close_ns = 22000,
    .frame_b_open_ns = 23000,
    .used = true,
};

static enum error check_with(size_t offset, uint32_t value)
{
    struct channel channel = LEGAL;
    *(uint32_t *)(void *)((char *)&channel + offset) = value;
    return pulse_train_check_channel(&channel);
}

#define WITH(member, value) check_with(offsetof(struct channel, member), value)

static void test_each_limit_holds_to_the_nanosecond(void)
{
    CHECK(pulse_train_check_channel(&LEGAL) == ERROR_NONE);
    CHECK(WITH(a_width_ns, MIN_WIDTH_NS) == ERROR_NONE && WITH(a_width_ns, MIN_WIDTH_NS - 1) == ERROR_WIDTH);
    CHECK(WITH(a_width_ns, MAX_WIDTH_NS) == ERROR_NONE && WITH(a_width_ns, MAX_WIDTH_NS + 1) == ERROR_WIDTH);
    CHECK(WITH(b_width_ns, MIN_WIDTH_NS) == ERROR_NONE && WITH(b_width_ns, MIN_WIDTH_NS - 1) == ERROR_WIDTH);
    CHECK(WITH(b_width_ns, MAX_WIDTH_NS) == ERROR_NONE && WITH(b_width_ns, MAX_WIDTH_NS + 1) == ERROR_WIDTH);
    CHECK(WITH(current_ma, MAX_CURRENT_MA) == ERROR_NONE && WITH(current_ma, MAX_CURRENT_MA + 1) == ERROR_CURRENT);
    CHECK(WITH(current_ma, 0) == ERROR_NONE);
    CHECK(WITH(b_start_ns, 20000 + MAX_SEPARATION_NS) == ERROR_NONE);
    CHECK(WITH(b_start_ns, 20000 + MAX_SEPARATION_NS + 1) == ERROR_SEPARATION);
    CHECK(WITH(camera_ns, MAX_EDGE_NS + 1) == ERROR_EDGE && WITH(b_start_ns, MAX_EDGE_NS + 1) == ERROR_EDGE);
    CHECK(WITH(a_start_ns, MAX_EDGE_NS) == ERROR_SEPARATION && WITH(a_start_ns, MAX_EDGE_NS + 1) == ERROR_EDGE);
}

static void test_pulses_keep_their_dark_time_and_order(void)
{
    struct channel channel = LEGAL;
    channel.frame_a_close_ns = channel.frame_b_open_ns = 20000; /* a boundary just where pulse A ends */
    channel.b_start_ns = channel.a_start_ns + channel.a_width_ns + MIN_DARK_NS;
    CHECK(pulse_train_check_channel(&channel) == ERROR_NONE);
    channel.b_start_ns--;
    CHECK(pulse_train_check_channel(&channel) == ERROR_SEPARATION);
    channel.b_start_ns = 0;
    CHECK(pulse_train_check_channel(&channel) == ERROR_SEPARATION);
}

static enum error check_single(uint32_t a_start_ns, uint32_t a_width_ns)
{
    struct channel channel = LEGAL;
    channel.a_start_ns = a_start_ns;
    channel.a_width_ns = a_width_ns;
    channel.b_start_ns = channel.b_width_ns = channel.frame_b_open_ns = 0;
    return pulse_train_check_channel(&channel);
}

static void test_a_single_pulse_keeps_the_limits_of_pulse_a(void)
{
    CHECK(check_single(20000, MIN_WIDTH_NS) == ERROR_NONE && check_single(20000, MIN_WIDTH_NS - 1) == ERROR_WIDTH);
    CHECK(check_single(20000, MAX_WIDTH_NS) == ERROR_NONE && check_single(20000, MAX_WIDTH_NS + 1) == ERROR_WIDTH);
    CHECK(check_single(22000, 1000) == ERROR_NONE && check_single(22001, 1000) == ERROR_STRADDLE);
    CHECK(WITH(b_width_ns, 0) == ERROR_WIDTH && WITH(b_start_ns, 0) == ERROR_SEPARATION);
}

static void test_every_channel_of_a_train_is_checked(void)
{
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        struct pulse_train train = {{LEGAL, LEGAL, LEGAL, LEGAL}};
        CHECK(pulse_train_check(&train) == ERROR_NONE);
        train.channels[i].a_width_ns = MAX_WIDTH_NS + 1;
        CHECK(pulse_train_check(&train) == ERROR_WIDTH);
        train.channels[i].used = false;
        CHECK(pulse_train_check(&train) == ERROR_NONE);
    }
}

static void test_frame_boundaries_count_from_the_camera_trigger(void)
{
    CHECK(WITH(frame_a_close_ns, 20000) == ERROR_NONE && WITH(frame_a_close_ns, 19999) == ERROR_STRADDLE);
    CHECK(WITH(frame_b_open_ns, 25400) == ERROR_NONE && WITH(frame_b_open_ns, 25401) == ERROR_STRADDLE);
    CHECK(WITH(camera_ns, 999) == ERROR_NONE && WITH(camera_ns, 4000) == ERROR_STRADDLE);
    CHECK(WITH(frame_b_open_ns, 21999) == ERROR_STRADDLE);
}

static void test_no_field_can_overflow_a_sum(void)
{
    CHECK(WITH(camera_ns, UINT32_MAX) == ERROR_EDGE && WITH(a_start_ns, UINT32_MAX) == ERROR_EDGE);
    CHECK(WITH(b_start_ns, UINT32_MAX) == ERROR_EDGE && WITH(a_width_ns, UINT32_MAX) == ERROR_WIDTH);
    CHECK(WITH(b_width_ns, UINT32_MAX) == ERROR_WIDTH && WITH(current_ma, UINT32_MAX) == ERROR_CURRENT);
    CHECK(WITH(frame_b_open_ns, UINT32_MAX) == ERROR_STRADDLE && WITH(frame_a_close_ns, UINT32_MAX) == ERROR_STRADDLE);
}

static void test_a_frame_boundary_beyond_32_bits_does_not_wrap(void)
{
    struct channel channel = LEGAL;
    channel.camera_ns = 30000;
    channel.frame_a_close_ns = UINT32_MAX - 6000; /* in 32 bits: 23999, a fine place between the pulses */
    channel.frame_b_open_ns = UINT32_MAX - 5000;
    CHECK(pulse_train_check_channel(&channel) == ERROR_STRADDLE);
    channel.frame_b_open_ns = 0;
    channel.b_start_ns = 31000;
    CHECK(pulse_train_check_channel(&channel) == ERROR_STRADDLE);
}

static void test_every_edge_goes_to_the_nearest_tick(void)
{
    for (uint32_t offset = 0; offset < 16; offset++) {
        struct channel requested = LEGAL;
        requested.a_start_ns += offset;
        requested.b_start_ns += offset;
        const struct channel actual = pulse_train_quantised(&requested, 8, 10);
        const int32_t moved_ns = (int32_t)(actual.a_start_ns - requested.a_start_ns);
        CHECK(actual.a_start_ns % 8 == 0 && moved_ns >= -4 && moved_ns <= 4);
        CHECK(actual.b_start_ns - actual.a_start_ns == 6400); /* 800 ticks, wherever pulse A stands */
    }
}

static void test_a_train_is_as_long_as_its_last_output(void)
{
    struct pulse_train train = {0};
    CHECK(pulse_train_check(&train) == ERROR_NO_TRAIN && pulse_train_length_ns(&train) == 0);
    train.channels[2] = LEGAL;
    CHECK(pulse_train_check(&train) == ERROR_NONE && pulse_train_length_ns(&train) == 27400);
    train.channels[2].camera_ns = 20000;
    CHECK(pulse_train_length_ns(&train) == 20000 + CAMERA_PULSE_NS && pulse_train_check(&train) == ERROR_STRADDLE);
}

static void test_more_light_lengthens_the_period(void)
{
    struct pulse_train train = {0};
    struct channel_limits limits[CHANNEL_COUNT];
    for (int i = 0; i < CHANNEL_COUNT; i++)
        limits[i] = channel_limits_absolute();
    train.channels[0] = train.channels[3] = LEGAL;
    CHECK(channel_limits_period_us(&train, limits) == MIN_PERIOD_US); /* 2 us of light, 200 ppm */
    train.channels[3].a_width_ns = 2000;
    CHECK(channel_limits_period_us(&train, limits) == 15000);
    train.channels[3].a_width_ns = 2001 - 1000;
    CHECK(channel_limits_period_us(&train, limits) == 10005);
    train.channels[3].current_ma = 0; /* dark: its widths do not count */
    CHECK(channel_limits_period_us(&train, limits) == MIN_PERIOD_US);
    limits[3].max_duty_ppm = 0; /* forbids light, and is no divisor */
    CHECK(channel_limits_period_us(&train, limits) == MIN_PERIOD_US);
    limits[0].max_duty_ppm = 1;
    CHECK(channel_limits_period_us(&train, limits) == 2000000);
}

static void test_a_train_is_over_before_the_next_one(void)
{
    struct pulse_train train = {0};
    struct channel_limits limits[CHANNEL_COUNT];
    for (int i = 0; i < CHANNEL_COUNT; i++)
        limits[i] = channel_limits_absolute();
    train.channels[1] = LEGAL;
    train.channels[1].camera_ns = 15000000;
    const uint32_t length_us = pulse_train_length_ns(&train) / 1000u;
    CHECK(length_us == 15010 && channel_limits_period_us(&train, limits) > length_us);
}

static void test_limits_only_become_tighter(void)
{
    const struct channel_limits widest = {UINT32_MAX, UINT32_MAX, UINT32_MAX};
    struct channel_limits limits = channel_limits_absolute();
    channel_limits_tighten(&limits, &widest);
    CHECK(limits.max_current_ma == MAX_CURRENT_MA && limits.max_duty_ppm == MAX_DUTY_PPM);
    channel_limits_tighten(&limits, &(struct channel_limits){12000, UINT32_MAX, UINT32_MAX});
    CHECK(limits.max_current_ma == 12000 && limits.max_duty_ppm == MAX_DUTY_PPM);
    channel_limits_tighten(&limits, &(struct channel_limits){12001, 50, 7});
    CHECK(limits.max_current_ma == 12000 && limits.max_duty_ppm == 50 && limits.max_light_ma == 7);
}

static void test_a_channel_keeps_its_own_limits(void)
{
    struct pulse_train train = {.channels = {[1] = LEGAL}};
    struct channel_limits limits[CHANNEL_COUNT] = {[1] = {20000, 1, 0}};
    CHECK(channel_limits_allow_train(&train, limits)); /* unused channels have no light that could be forbidden */
    limits[1].max_current_ma = 19999;
    CHECK(!channel_limits_allow_train(&train, limits));
    limits[1] = (struct channel_limits){20000, 0, 0};
    CHECK(!channel_limits_allow_train(&train, limits));
    train.channels[1].current_ma = 0;
    CHECK(channel_limits_allow_train(&train, limits));
}

/* Self-protection of a published LED controller: longest pulse and highest duty up to a current. */
static void test_the_absolute_limits_are_tighter_than_the_published_led_table(void)
{
    const struct {
        uint32_t current_ma, pulse_ns, duty_ppm;
    } rows[] = {{15000, 10000000, 200000}, {25000, 2000000, 100000}, {40000, 1000000, 50000}};
    uint32_t covered_ma = 0;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        CHECK(MAX_WIDTH_NS < rows[i].pulse_ns && MAX_DUTY_PPM < rows[i].duty_ppm);
        covered_ma = rows[i].current_ma;
    }
    CHECK(covered_ma >= MAX_CURRENT_MA);
}

int main(void)
{
    test_each_limit_holds_to_the_nanosecond();
    test_pulses_keep_their_dark_time_and_order();
    test_a_single_pulse_keeps_the_limits_of_pulse_a();
    test_every_channel_of_a_train_is_checked();
    test_frame_boundaries_count_from_the_camera_trigger();
    test_no_field_can_overflow_a_sum();
    test_a_frame_boundary_beyond_32_bits_does_not_wrap();
    test_every_edge_goes_to_the_nearest_tick();
    test_a_train_is_as_long_as_its_last_output();
    test_more_light_lengthens_the_period();
    test_a_train_is_over_before_the_next_one();
    test_limits_only_become_tighter();
    test_a_channel_keeps_its_own_limits();
    test_the_absolute_limits_are_tighter_than_the_published_led_table();
    return 0;
}
