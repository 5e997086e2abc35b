"""The train that the generator reports against the one that was asked for."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq.run.shots.train_check import TOLERANCE_NS, train_deviation
from daq.run_plan import PulsePair, RunPlan
from daq.shot import FiredTrain, LightPulse
from daq.timing import CameraTiming, ShotTiming, plan_shot_timing

CAMERAS = {
    "view1": CameraTiming(1000, 20_000, 2000, 30_000_000, 1_000_000),
    "view2": CameraTiming(5000, 8000, 500, 30_000_000, 1_000_000),
}


def timing_of(current_a: float = 20.0) -> ShotTiming:
    plan = RunPlan(name="spray", shots=1, pulse=PulsePair(current_a={"view1": 26.0, "view2": current_a}))
    return plan_shot_timing(plan, CAMERAS)


def train_of(timing: ShotTiming, shift_ns: int = 0, tick_ns: int = 1) -> FiredTrain:
    def tick(edge_ns: int) -> int:
        return (edge_ns + shift_ns) // tick_ns * tick_ns

    return FiredTrain(
        1,
        {name: tick(view.camera_trigger_ns) for name, view in timing.views.items()},
        {
            name: tuple(
                LightPulse(tick(pulse.open_ns), (pulse.close_ns - pulse.open_ns) // tick_ns * tick_ns, view.current_a)
                for pulse in (view.pulse_a, view.pulse_b)
            )
            for name, view in timing.views.items()
        },
    )


@given(shift_ns=st.integers(-100_000, 100_000), tick_ns=st.integers(1, 8), current_a=st.sampled_from([0.0, 20.0]))
def test_shift_and_quantisation_are_no_deviation(shift_ns: int, tick_ns: int, current_a: float) -> None:
    timing = timing_of(current_a)
    assert train_deviation(timing, train_of(timing, shift_ns, tick_ns)) is None


@given(
    view=st.sampled_from(sorted(CAMERAS)),
    number=st.sampled_from([0, 1]),
    error_ns=st.integers(TOLERANCE_NS + 1, 5000),
    sign=st.sampled_from([-1, 1]),
)
def test_a_misplaced_pulse_is_named(view: str, number: int, error_ns: int, sign: int) -> None:
    train = train_of(timing_of(), 7000)
    pulses = list(train.pulses[view])
    pulses[number] = replace(pulses[number], start_ns=pulses[number].start_ns + sign * error_ns)
    deviation = train_deviation(timing_of(), replace(train, pulses={**train.pulses, view: tuple(pulses)}))
    assert deviation is not None
    assert deviation.startswith(f"start of pulse {number} of {view} is ")


def test_a_dark_channel_may_be_reported_without_pulses() -> None:
    train = train_of(timing_of(0.0))
    assert train_deviation(timing_of(0.0), replace(train, pulses={**train.pulses, "view2": ()})) is None


@pytest.mark.parametrize(
    ("pulses", "deviation"),
    [
        ((), "start of pulse 0 of view2 is missing"),
        ((LightPulse(0, 1000, 20.0),), "start of pulse 1 of view2 is missing"),
        ((LightPulse(0, 2000, 20.0), LightPulse(6400, 1000, 20.0)), "width of pulse 0 of view2 is 2000 ns"),
        ((LightPulse(0, 1000, 9.0), LightPulse(6400, 1000, 9.0)), "current of view2 is 9 A instead of 20 A"),
    ],
)
def test_what_differs_is_named(pulses: tuple[LightPulse, ...], deviation: str) -> None:
    train = train_of(timing_of())
    found = train_deviation(timing_of(), replace(train, pulses={**train.pulses, "view2": pulses}))
    assert found is not None
    assert found.startswith(deviation)


def test_light_that_nobody_asked_for_is_named() -> None:
    found = train_deviation(timing_of(0.0), train_of(timing_of(20.0)))
    assert found == "start of pulse 0 of view2 is not asked for"


def test_a_missing_camera_trigger_is_named() -> None:
    train = train_of(timing_of())
    found = train_deviation(timing_of(), replace(train, camera_trigger_ns={"view1": 0}))
    assert found == "camera triggers of ['view1'] instead of ['view1', 'view2']"
