/* When light is allowed, and what takes the permission away. */
#include "fake_port.h"
#include "generator.h"
#include "safety.h"
#include "shooting.h"
#include "sum.h"

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
    safety_heard(&generator);
    generator_poll(&generator);
}

static enum error arm(uint32_t shots)
{
    return shooting_arm(&generator, shots, SOURCE_COMMAND, 0);
}

static void boot(void)
{
    fake_reset();
    generator_boot(&generator, CAUSE_POWER);
    wait_us(2 * MIN_PERIOD_US);
}

static void boot_armed(uint32_t shots)
{
    boot();
    CHECK(!safety_new_train(&generator) && !safety_set_channel(&generator, 0, &LEGAL) && !safety_load(&generator));
    CHECK(arm(shots) == ERROR_NONE && generator.state == STATE_ARMED && fake.live);
}

static void check_counters_add_up(void)
{
    CHECK(generator.counters.requested == generator.counters.fired + generator.counters.suppressed);
    CHECK(generator.counters.early <= generator.counters.suppressed && generator.counters.fired == fake.fired);
}

static void test_nothing_works_before_arming(void)
{
    boot();
    CHECK(generator.state == STATE_SAFE && !fake.live);
    CHECK(shooting_fire(&generator) == ERROR_NOT_ARMED && arm(1) == ERROR_NO_TRAIN);
    CHECK(safety_load(&generator) == ERROR_NO_TRAIN && fake.fired == 0);
    check_counters_add_up();
}

static void test_the_budget_is_exact(void)
{
    boot_armed(3);
    for (uint32_t left = 3; left-- > 0;) {
        CHECK(shooting_fire(&generator) == ERROR_NONE && generator.shots_left == left);
        wait_us(MIN_PERIOD_US);
    }
    CHECK(generator.state == STATE_SAFE && shooting_fire(&generator) == ERROR_NOT_ARMED && fake.fired == 3);
    check_counters_add_up();
}

static void test_the_last_train_ends_before_the_outputs_are_cut(void)
{
    boot_armed(1);
    CHECK(shooting_fire(&generator) == ERROR_NONE && generator.state == STATE_SAFE);
    wait_us(28); /* the train lasts 27.4 */
    CHECK(fake.live);
    wait_us(1);
    CHECK(!fake.live);
}

static void test_the_budget_has_bounds(void)
{
    boot_armed(MAX_SHOTS);
    safety_off(&generator);
    CHECK(arm(0) == ERROR_SHOTS && arm(MAX_SHOTS + 1) == ERROR_SHOTS);
}

static void test_an_early_shot_is_ignored_and_counted(void)
{
    boot_armed(5);
    CHECK(shooting_fire(&generator) == ERROR_NONE);
    wait_us(MIN_PERIOD_US - 1);
    CHECK(shooting_fire(&generator) == ERROR_EARLY && generator.state == STATE_ARMED && generator.shots_left == 4);
    CHECK(fake.fired == 1 && generator.counters.early == 1);
    wait_us(1);
    CHECK(shooting_fire(&generator) == ERROR_NONE && fake.fired == 2);
    check_counters_add_up();
}

static void test_arming_again_does_not_shorten_the_period(void)
{
    boot_armed(1);
    CHECK(shooting_fire(&generator) == ERROR_NONE);
    wait_us(5000);
    CHECK(arm(1) == ERROR_NONE && shooting_fire(&generator) == ERROR_EARLY);
}

/* It does not know what was fired before: it waits as long as the longest train demands, 4 us of light at 200 ppm. */
static void test_a_start_does_not_shorten_the_period(void)
{
    boot_armed(1);
    CHECK(shooting_fire(&generator) == ERROR_NONE);
    generator_boot(&generator, CAUSE_POWER);
    CHECK(!safety_set_channel(&generator, 0, &LEGAL) && !safety_load(&generator) && !arm(1));
    wait_us(20000 - 1);
    CHECK(shooting_fire(&generator) == ERROR_EARLY);
    wait_us(1);
    CHECK(shooting_fire(&generator) == ERROR_NONE);
}

static void test_an_armed_generator_takes_no_other_train(void)
{
    boot_armed(1);
    CHECK(safety_new_train(&generator) == ERROR_NOT_SAFE &&
          safety_set_channel(&generator, 1, &LEGAL) == ERROR_NOT_SAFE);
    CHECK(safety_load(&generator) == ERROR_NOT_SAFE && arm(9) == ERROR_NOT_SAFE);
    CHECK(safety_clear(&generator) == ERROR_NOT_SAFE && generator.shots_left == 1);
}

static void test_a_changed_channel_must_be_loaded_again(void)
{
    boot_armed(1);
    safety_off(&generator);
    CHECK(safety_set_channel(&generator, 1, &LEGAL) == ERROR_NONE && arm(1) == ERROR_NO_TRAIN);
    CHECK(safety_set_channel(&generator, CHANNEL_COUNT, &LEGAL) == ERROR_CHANNEL);
    CHECK(safety_load(&generator) == ERROR_NONE && arm(1) == ERROR_NONE && generator.train_id == 2);
}

static void test_actual_values_must_keep_the_limits_too(void)
{
    boot();
    struct channel channel = LEGAL;
    channel.a_start_ns = 20004; /* each goes up by half a tick, */
    channel.a_width_ns = 1004;
    channel.b_start_ns = 20004 + 1004 + MIN_DARK_NS; /* and this one stays */
    channel.frame_a_close_ns = 21100;
    channel.frame_b_open_ns = 21200;
    CHECK(pulse_train_check_channel(&channel) == ERROR_NONE);
    CHECK(safety_set_channel(&generator, 0, &channel) == ERROR_SEPARATION);
}

static void test_a_channel_refuses_more_than_its_own_limit(void)
{
    boot();
    CHECK(safety_tighten(&generator, CHANNEL_COUNT, &(struct channel_limits){1, 1, UINT32_MAX}) == ERROR_CHANNEL);
    CHECK(safety_tighten(&generator, 0, &(struct channel_limits){19999, MAX_DUTY_PPM, UINT32_MAX}) == ERROR_NONE);
    CHECK(safety_set_channel(&generator, 0, &LEGAL) == ERROR_LIMIT && safety_load(&generator) == ERROR_NO_TRAIN);
    CHECK(safety_set_channel(&generator, 1, &LEGAL) == ERROR_NONE);
    CHECK(safety_tighten(&generator, 0, &(struct channel_limits){UINT32_MAX, UINT32_MAX, UINT32_MAX}) == ERROR_NONE);
    CHECK(safety_set_channel(&generator, 0, &LEGAL) == ERROR_LIMIT);
}

static void test_a_loaded_train_does_not_survive_a_tighter_limit(void)
{
    boot_armed(5);
    CHECK(safety_tighten(&generator, 0, &(struct channel_limits){1, 1, UINT32_MAX}) == ERROR_NOT_SAFE);
    safety_off(&generator);
    CHECK(safety_tighten(&generator, 0, &(struct channel_limits){10000, MAX_DUTY_PPM, UINT32_MAX}) == ERROR_NONE);
    CHECK(arm(1) == ERROR_NO_TRAIN && safety_load(&generator) == ERROR_LIMIT);
    generator_boot(&generator, CAUSE_POWER);
    CHECK(generator.limits[0].max_current_ma == MAX_CURRENT_MA);
}

static void test_a_tighter_duty_lengthens_the_period(void)
{
    boot_armed(5);
    safety_off(&generator);
    CHECK(safety_tighten(&generator, 0, &(struct channel_limits){30000, 20, UINT32_MAX}) == ERROR_NONE &&
          safety_load(&generator) == ERROR_NONE);
    CHECK(arm(5) == ERROR_NONE && shooting_fire(&generator) == ERROR_NONE);
    wait_us(100000 - 1); /* 2 us of light at 20 ppm */
    CHECK(shooting_fire(&generator) == ERROR_EARLY);
    wait_us(1);
    CHECK(shooting_fire(&generator) == ERROR_NONE);
}

static void test_a_limit_that_was_broken_in_memory_is_not_fired(void)
{
    boot_armed(2);
    generator.limits[0].max_current_ma = 1;
    CHECK(shooting_fire(&generator) == ERROR_FAULT_LATCHED && fake.fired == 0 && generator.faults == FAULT_INTERNAL);
}

static void test_off_disarms_and_forgets_the_budget(void)
{
    boot_armed(7);
    safety_off(&generator);
    CHECK(generator.state == STATE_SAFE && !fake.live && generator.shots_left == 0);
    CHECK(shooting_fire(&generator) == ERROR_NOT_ARMED);
}

static void test_an_open_interlock_trips_and_latches(void)
{
    boot_armed(2);
    fake.interlock_closed = false;
    generator_poll(&generator);
    CHECK(generator.state == STATE_FAULT && generator.faults == FAULT_INTERLOCK && !fake.live);
    CHECK(safety_clear(&generator) == ERROR_INTERLOCK_OPEN);
    fake.interlock_closed = true;
    generator_poll(&generator);
    CHECK(generator.state == STATE_FAULT && shooting_fire(&generator) == ERROR_FAULT_LATCHED);
    CHECK(arm(1) == ERROR_FAULT_LATCHED && safety_new_train(&generator) == ERROR_FAULT_LATCHED);
    CHECK(safety_clear(&generator) == ERROR_NONE && generator.state == STATE_SAFE && generator.shots_left == 0);
    check_counters_add_up();
}

static void test_the_interlock_is_asked_at_the_moment_of_firing(void)
{
    boot_armed(2);
    fake.interlock_closed = false;
    CHECK(shooting_fire(&generator) == ERROR_INTERLOCK_OPEN && fake.fired == 0 && generator.state == STATE_FAULT);
}

static void test_an_open_interlock_forbids_arming_without_a_fault(void)
{
    boot_armed(1);
    safety_off(&generator);
    fake.interlock_closed = false;
    generator_poll(&generator);
    CHECK(arm(1) == ERROR_INTERLOCK_OPEN && generator.state == STATE_SAFE && generator.faults == 0);
}

static void test_a_silent_host_trips(void)
{
    boot_armed(2);
    fake.now_us += HEARTBEAT_MS * 1000u;
    generator_poll(&generator);
    CHECK(generator.state == STATE_ARMED);
    fake.now_us++;
    generator_poll(&generator);
    CHECK(generator.state == STATE_FAULT && generator.faults == FAULT_HEARTBEAT && !fake.live);
}

static void test_a_safe_generator_needs_no_host(void)
{
    boot();
    fake.now_us += HEARTBEAT_MS * 5000u;
    generator_poll(&generator);
    CHECK(generator.state == STATE_SAFE);
}

static void test_set_points_that_are_not_confirmed_as_zero_trip_and_latch(void)
{
    boot_armed(2);
    safety_off(&generator);
    fake.set_points_stuck = true;
    generator_poll(&generator);
    CHECK(generator.state == STATE_FAULT && generator.faults == FAULT_SETPOINT && !fake.live);
    CHECK(arm(1) == ERROR_FAULT_LATCHED && safety_clear(&generator) == ERROR_HARDWARE);
    fake.set_points_stuck = false;
    generator_poll(&generator);
    CHECK(generator.state == STATE_FAULT && arm(1) == ERROR_FAULT_LATCHED);
    CHECK(safety_clear(&generator) == ERROR_NONE && generator.state == STATE_SAFE && arm(1) == ERROR_NONE);
}

static void test_set_points_that_stay_after_the_last_shot_trip_too(void)
{
    boot_armed(2);
    fake.set_points_stuck = true;
    generator_poll(&generator);
    CHECK(generator.state == STATE_FAULT && generator.shots_left == 0 && !fake.live);
}

static void test_a_watchdog_reset_boots_into_a_fault(void)
{
    fake_reset();
    generator_boot(&generator, CAUSE_WATCHDOG);
    CHECK(generator.state == STATE_FAULT && generator.faults == FAULT_WATCHDOG &&
          safety_load(&generator) == ERROR_FAULT_LATCHED);
    CHECK(safety_clear(&generator) == ERROR_NONE && generator.state == STATE_SAFE);
}

static void test_a_train_that_changed_in_memory_is_not_fired(void)
{
    boot_armed(2);
    generator.train.channels[0].a_width_ns = 1u << 20;
    CHECK(shooting_fire(&generator) == ERROR_FAULT_LATCHED && fake.fired == 0 && generator.faults == FAULT_INTERNAL);
}

static void test_hardware_that_cannot_produce_the_train_stays_dark(void)
{
    boot_armed(1);
    safety_off(&generator);
    fake.can_load = false;
    CHECK(arm(1) == ERROR_HARDWARE && generator.state == STATE_SAFE && !fake.live);
}

static void test_arming_waits_for_the_end_of_the_last_train(void)
{
    boot_armed(1);
    CHECK(shooting_fire(&generator) == ERROR_NONE && generator.state == STATE_SAFE && fake.live);
    CHECK(arm(1) == ERROR_EARLY && fake.live && generator.state == STATE_SAFE);
    wait_us(28);
    CHECK(arm(1) == ERROR_EARLY);
    wait_us(1);
    CHECK(arm(1) == ERROR_NONE);
}

static void test_a_stop_that_opens_while_arming_trips_and_latches(void)
{
    for (int estop = 0; estop < 2; estop++) {
        boot_armed(1);
        safety_off(&generator);
        fake.opens = estop ? &fake.estop_closed : &fake.interlock_closed;
        CHECK(arm(5) == (estop ? ERROR_ESTOP_OPEN : ERROR_INTERLOCK_OPEN) && !fake.live);
        CHECK(generator.state == STATE_FAULT && generator.faults == (estop ? FAULT_ESTOP : FAULT_INTERLOCK));
        fake.estop_closed = fake.interlock_closed = true;
        CHECK(arm(5) == ERROR_FAULT_LATCHED && !generator.shots_left);
    }
}

/* Another legal value, which no limit would find. */
static void test_a_changed_train_is_not_armed_and_not_cleared_into_one(void)
{
    boot_armed(1);
    safety_off(&generator);
    generator.train.channels[0].a_width_ns += 8;
    CHECK(arm(1) == ERROR_FAULT_LATCHED && generator.faults == FAULT_INTERNAL && !fake.live);
    CHECK(safety_clear(&generator) == ERROR_NONE && arm(1) == ERROR_NO_TRAIN &&
          safety_load(&generator) == ERROR_NO_TRAIN);
    CHECK(!safety_set_channel(&generator, 0, &LEGAL) && !safety_load(&generator) && !arm(1));
    generator.train.channels[0].b_start_ns += 8;
    CHECK(shooting_fire(&generator) == ERROR_FAULT_LATCHED && fake.fired == 0 && generator.faults == FAULT_INTERNAL);
    CHECK(safety_clear(&generator) == ERROR_NONE && arm(1) == ERROR_NO_TRAIN);
    CHECK(!safety_set_channel(&generator, 0, &LEGAL) && !safety_load(&generator) && !arm(1));
    generator.train.channels[0].a_width_ns = MAX_WIDTH_NS + 8; /* with a sum that fits */
    generator.train_sum = sum_of(&generator.train, sizeof generator.train);
    CHECK(shooting_fire(&generator) == ERROR_FAULT_LATCHED && generator.faults == FAULT_INTERNAL);
    boot_armed(1);
    generator.shots_left = 0;
    CHECK(shooting_fire(&generator) == ERROR_FAULT_LATCHED && generator.faults == FAULT_INTERNAL && fake.fired == 0);
    boot();
    CHECK(!safety_set_channel(&generator, 0, &LEGAL));
    generator.train.channels[3].used = true;
    CHECK(safety_load(&generator) == ERROR_FAULT_LATCHED);
}

static void test_a_changed_limit_stays_a_fault(void)
{
    boot_armed(1);
    safety_off(&generator);
    generator.limits[1].max_light_ma--;
    CHECK(safety_tighten(&generator, 0, &(struct channel_limits){1, 1, 1}) == ERROR_FAULT_LATCHED);
    CHECK(generator.faults == FAULT_INTERNAL && safety_clear(&generator) == ERROR_HARDWARE);
    boot();
    generator.limits[1].max_duty_ppm++;
    CHECK(safety_set_channel(&generator, 0, &LEGAL) == ERROR_FAULT_LATCHED && generator.faults == FAULT_INTERNAL);
}

static void test_currents_are_whole_steps_and_never_above_what_was_asked(void)
{
    const uint32_t asked_ma[] = {0, 5, 9, 10, 25996, 29999, 30000};
    const uint32_t actual_ma[] = {0, 0, 0, 10, 25990, 29990, 30000};
    boot();
    for (size_t i = 0; i < sizeof asked_ma / sizeof *asked_ma; i++) {
        struct channel channel = LEGAL;
        channel.current_ma = asked_ma[i];
        CHECK(!safety_set_channel(&generator, 0, &channel));
        CHECK(generator.train.channels[0].current_ma == actual_ma[i]);
    }
    CHECK(!safety_tighten(&generator, 0, &(struct channel_limits){19996, MAX_DUTY_PPM, 0}));
    struct channel channel = LEGAL;
    channel.current_ma = 19996;
    CHECK(!safety_set_channel(&generator, 0, &channel) && generator.train.channels[0].current_ma == 19990);
    channel.current_ma = 19997;
    CHECK(safety_set_channel(&generator, 0, &channel) == ERROR_LIMIT);
}

static void test_all_causes_at_once_are_named(void)
{
    boot_armed(2);
    fake.interlock_closed = fake.estop_closed = false;
    fake.set_points_stuck = fake.damaged = true;
    fake.stuck_lights = 8;
    fake.now_us += HEARTBEAT_MS * 1000u + 1u;
    generator_poll(&generator);
    CHECK(generator.faults ==
          (FAULT_INTERLOCK | FAULT_ESTOP | FAULT_SETPOINT | FAULT_INTERNAL | FAULT_OUTPUT | FAULT_HEARTBEAT));
    boot_armed(2);
    fake.interlock_closed = false;
    generator.train.channels[0].a_width_ns += 8;
    CHECK(shooting_fire(&generator) == ERROR_INTERLOCK_OPEN && generator.faults == (FAULT_INTERLOCK | FAULT_INTERNAL));
    boot_armed(2);
    fake.interlock_closed = fake.estop_closed = false;
    CHECK(shooting_fire(&generator) == ERROR_ESTOP_OPEN && generator.faults == (FAULT_INTERLOCK | FAULT_ESTOP));
}

static void test_clocks_that_do_not_agree_trip_and_stay_a_fault(void)
{
    boot_armed(5);
    fake.clock_wrong = true;
    wait_us(1);
    CHECK(generator.state == STATE_FAULT && generator.faults == FAULT_CLOCK && !fake.live);
    CHECK(safety_clear(&generator) == ERROR_HARDWARE);
    boot();
    fake.clock_wrong = true;
    wait_us(1);
    CHECK(generator.faults == FAULT_CLOCK);
}

int main(void)
{
    test_clocks_that_do_not_agree_trip_and_stay_a_fault();
    test_arming_waits_for_the_end_of_the_last_train();
    test_a_stop_that_opens_while_arming_trips_and_latches();
    test_a_changed_train_is_not_armed_and_not_cleared_into_one();
    test_a_changed_limit_stays_a_fault();
    test_currents_are_whole_steps_and_never_above_what_was_asked();
    test_all_causes_at_once_are_named();
    test_nothing_works_before_arming();
    test_the_budget_is_exact();
    test_the_last_train_ends_before_the_outputs_are_cut();
    test_the_budget_has_bounds();
    test_an_early_shot_is_ignored_and_counted();
    test_arming_again_does_not_shorten_the_period();
    test_a_start_does_not_shorten_the_period();
    test_an_armed_generator_takes_no_other_train();
    test_a_changed_channel_must_be_loaded_again();
    test_actual_values_must_keep_the_limits_too();
    test_a_channel_refuses_more_than_its_own_limit();
    test_a_loaded_train_does_not_survive_a_tighter_limit();
    test_a_tighter_duty_lengthens_the_period();
    test_a_limit_that_was_broken_in_memory_is_not_fired();
    test_off_disarms_and_forgets_the_budget();
    test_an_open_interlock_trips_and_latches();
    test_the_interlock_is_asked_at_the_moment_of_firing();
    test_an_open_interlock_forbids_arming_without_a_fault();
    test_a_silent_host_trips();
    test_a_safe_generator_needs_no_host();
    test_set_points_that_are_not_confirmed_as_zero_trip_and_latch();
    test_set_points_that_stay_after_the_last_shot_trip_too();
    test_a_watchdog_reset_boots_into_a_fault();
    test_a_train_that_changed_in_memory_is_not_fired();
    test_hardware_that_cannot_produce_the_train_stays_dark();
    return 0;
}
