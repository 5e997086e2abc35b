"""Frame straddling: pulse A ends in frame A, pulse B starts in frame B, or the plan is refused."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq.errors import PlanError
from daq.run_plan import PulsePair, RunPlan
from daq.timing import CameraTiming, Window, plan_shot_timing

CAMERA = CameraTiming(
    trigger_delay_ns=500, exposure_a_ns=10_000, gap_ns=1_000, exposure_b_ns=30_000_000, readout_ns=30_000_000
)


def plan(width_ns: int = 1000, separation_ns: int = 6400, rate_hz: float = 10.0) -> RunPlan:
    pulse = PulsePair(width_ns=width_ns, separation_ns=separation_ns, current_a={"view1": 20.0})
    return RunPlan(name="test", shots=1, rate_hz=rate_hz, pulse=pulse)


@given(
    st.integers(250, 2000), st.integers(2000, 200_000), st.integers(0, 2000), st.integers(0, 3000), st.integers(0, 500)
)
def test_every_accepted_plan_straddles(width: int, separation: int, delay: int, gap: int, guard: int) -> None:
    camera = CameraTiming(delay, 10_000, gap, 30_000_000, 30_000_000, guard)
    try:
        view = plan_shot_timing(plan(width, separation), {"view1": camera}).views["view1"]
    except PlanError:
        assert separation < camera.straddling_ns(width)[0]
        return
    assert view.frame_a.open_ns + guard <= view.pulse_a.open_ns
    assert view.pulse_a.close_ns + guard <= view.frame_a.close_ns
    assert view.frame_b.open_ns + guard <= view.pulse_b.open_ns
    assert view.pulse_a.overlap_ns(view.frame_b) == view.pulse_b.overlap_ns(view.frame_a) == 0
    assert view.pulse_b.open_ns - view.pulse_a.open_ns == separation
    assert view.frame_a.open_ns - view.camera_trigger_ns == delay


def test_cameras_of_different_delay_see_the_same_pulses() -> None:
    slow = CameraTiming(3_000, 10_000, 1_000, 30_000_000, 30_000_000)
    pulse = PulsePair(current_a={"view1": 20.0, "view2": 9.9})
    timing = plan_shot_timing(RunPlan(name="t", shots=1, pulse=pulse), {"view1": CAMERA, "view2": slow})
    assert timing.views["view1"].pulse_a == timing.views["view2"].pulse_a == Window(0, 1000)
    assert timing.views["view1"].camera_trigger_ns - timing.views["view2"].camera_trigger_ns == 2_500


def test_impossible_separation_names_value_and_limit() -> None:
    with pytest.raises(PlanError, match=r"2000 ns is below 2400 ns, the limit of camera view1"):
        plan_shot_timing(plan(separation_ns=2000), {"view1": CAMERA})


def test_rate_above_the_camera_is_refused() -> None:
    with pytest.raises(PlanError, match=r"100 Hz is above 16\.66 Hz"):
        plan_shot_timing(plan(rate_hz=100), {"view1": CAMERA})


def test_unknown_view_is_refused() -> None:
    with pytest.raises(PlanError, match="view9"):
        plan_shot_timing(RunPlan(name="t", shots=1, pulse=PulsePair(current_a={"view9": 1.0})), {"view1": CAMERA})


def test_windows_overlap_by_their_common_part() -> None:
    assert Window(0, 10).overlap_ns(Window(4, 20)) == 6
    assert Window(0, 10).overlap_ns(Window(10, 20)) == 0


timings = st.builds(
    CameraTiming,
    trigger_delay_ns=st.integers(0, 3000),
    exposure_a_ns=st.integers(3000, 20_000),
    gap_ns=st.integers(0, 3000),
    exposure_b_ns=st.integers(3000, 200_000),
    readout_ns=st.just(1000),
    guard_ns=st.integers(0, 400),
)


@given(timings, st.integers(250, 2000), st.integers(2000, 200_000))
def test_the_planner_accepts_exactly_the_window(camera: CameraTiming, width: int, separation: int) -> None:
    shortest_ns, longest_ns = camera.straddling_ns(width)
    try:
        plan_shot_timing(plan(width, separation), {"view1": camera})
        accepted = True
    except PlanError:
        accepted = False
    assert accepted == (shortest_ns <= separation <= longest_ns)


def test_a_pulse_longer_than_the_exposure_is_refused_with_both_values() -> None:
    short = CameraTiming(500, exposure_a_ns=2100, gap_ns=1, exposure_b_ns=9_000, readout_ns=9_000)
    assert short.has_room_for(1700)
    assert not short.has_room_for(1701)
    with pytest.raises(PlanError, match=r"2000 ns does not fit the exposure of view1, 2100 ns"):
        plan_shot_timing(plan(width_ns=2000), {"view1": short})
