"""Periods of shots do not depend on a clock that somebody sets."""

from daq.run.shots.firing_clock import FiringClock


def test_a_clock_that_is_set_back_changes_no_period_and_is_told() -> None:
    unix_ns = iter([1_000_000_000_000, 1_000_100_000_000, 940_200_000_000, 940_300_000_500])
    steady_ns = iter([5_000_000_000, 5_100_000_000, 5_200_000_000, 5_300_000_000])
    clock = FiringClock(lambda: next(unix_ns), lambda: next(steady_ns))
    times = [clock.now() for _ in range(4)]
    assert [one.period_ns for one in times] == [0, 100_000_000, 100_000_000, 100_000_000]
    assert [one.clock_step_ns for one in times] == [0, 0, -60_000_000_000, 500]
