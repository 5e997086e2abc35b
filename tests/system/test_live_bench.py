"""The live view on the simulated bench: real drivers, real Aravis, the firmware's own core."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

from daq.devices import GeneratorState
from daq.errors import DeviceOvertaken, PlanError
from daq.faults import Fault, FaultKind
from daq.run.acquisition import Acquisition
from daq.run.limits import AcquisitionLimits
from daq.run.state import RunOutcome, RunState
from daq.run_plan import LivePlan, PulsePair, RunPlan
from daq.shot import Shot
from server.rig.assembly import AssembledRig, open_rig
from server.rig.config import load_config
from tests.support.simulated_serving import CURRENT_A, tiny_config

pytestmark = pytest.mark.network
SMALL = load_config(Path("configs/simulated_small.toml"))
LIMITS = AcquisitionLimits(frame_s=2.5)
DEADLINE_S = 30.0
PULSE = PulsePair(current_a={name: view.nominal_current_a for name, view in SMALL.views.items()})
LIT = LivePlan(rate_hz=5, pulse=PULSE)


@pytest.fixture(scope="module")
def assembled() -> Iterator[AssembledRig]:
    with open_rig(SMALL) as opened:
        yield opened


@contextmanager
def showing(assembled: AssembledRig, data_dir: Path, plan: LivePlan) -> Iterator[tuple[Acquisition, Shot]]:
    """A live view, and its first shot."""
    with Acquisition(assembled.rig, data_dir, limits=LIMITS, observers=assembled.observers) as acquisition:
        acquisition.start_live(plan)
        yield acquisition, next_shot(acquisition, -1)


def next_shot(acquisition: Acquisition, index: int) -> Shot:
    def has_come() -> bool:
        shot = acquisition.newest_shot
        return shot is not None and shot.index > index

    await_true(has_come)
    shot = acquisition.newest_shot
    assert shot is not None
    return shot


def await_true(condition: Callable[[], bool]) -> None:
    deadline, tick = time.monotonic() + DEADLINE_S, threading.Event()
    while not condition():
        assert time.monotonic() < deadline
        tick.wait(0.005)


def is_dark(assembled: AssembledRig) -> bool:
    """What the generator says, unless its answer is overtaken by another command to be off."""
    with suppress(DeviceOvertaken):
        return assembled.rig.generator.status().state not in (GeneratorState.ARMED, GeneratorState.LIT)
    return False


def test_both_exposures_of_a_moving_spray_are_lit_and_a_run_takes_over(assembled: AssembledRig, tmp_path: Path) -> None:
    with showing(assembled, tmp_path, LIT) as (acquisition, first):
        second = next_shot(acquisition, first.index)
        for view in PULSE.current_a:
            frame_a, frame_b = first.views[view].frame_a, first.views[view].frame_b
            assert frame_b is not None
            assert first.views[view].valid
            assert 60 < np.median(frame_a) < 170
            assert 60 < np.median(frame_b) < 170
            moved, noise = np.abs(frame_b.astype(float) - frame_a), np.abs(np.diff(frame_a[:8].astype(float)))
            assert np.percentile(moved, 99.9) > 2 * np.percentile(noise, 99)
            assert np.any(second.views[view].frame_a != frame_a)
        assert not list(tmp_path.iterdir())
        acquisition.start(RunPlan(name="spray", shots=1, rate_hz=5, pulse=PULSE))
        status = acquisition.wait(DEADLINE_S)
        assert (status.outcome, status.shots_valid) == (RunOutcome.COMPLETED, 1)


def test_room_light_is_shown_without_ours(assembled: AssembledRig, tmp_path: Path) -> None:
    with showing(assembled, tmp_path, LivePlan(rate_hz=5)) as (acquisition, shot):
        assert all(np.median(frames.frame_a) < 20 for frames in shot.views.values())
        assert shot.fired is not None
        assert not any(shot.fired.pulses.values())
        acquisition.end_live()
        assert acquisition.wait(DEADLINE_S).state is RunState.IDLE
    assert is_dark(assembled)


def test_a_current_above_the_limit_of_its_led_is_refused(assembled: AssembledRig, tmp_path: Path) -> None:
    too_high = PULSE.model_copy(update={"current_a": PULSE.current_a | {"view2": 12.5}})
    with Acquisition(assembled.rig, tmp_path) as acquisition:
        with pytest.raises(PlanError, match=r"12\.5 A is above 12 A, the limit of the LED of view2"):
            acquisition.start_live(LivePlan(pulse=too_high))
        assert acquisition.status().state is RunState.IDLE


def test_a_door_that_opens_darkens_and_is_named(assembled: AssembledRig, tmp_path: Path) -> None:
    laboratory = assembled.laboratory
    assert laboratory is not None
    with showing(assembled, tmp_path, LIT) as (acquisition, _):
        try:
            laboratory.open_door()
            await_true(lambda: is_dark(assembled))
            status = acquisition.wait(DEADLINE_S)
            assert status.state is RunState.IDLE
            assert "interlock" in status.message
        finally:
            laboratory.close_door()
        acquisition.acknowledge()


def test_an_abort_darkens_and_what_comes_next_works(assembled: AssembledRig, tmp_path: Path) -> None:
    with showing(assembled, tmp_path, LIT) as (acquisition, shot):
        acquisition.abort()
        await_true(lambda: is_dark(assembled))
        assert acquisition.wait(DEADLINE_S).message == "aborted by the operator"
        acquisition.start_live(LIT)
        await_true(lambda: acquisition.newest_shot is not shot)


def test_a_camera_that_dies_is_named_and_holds_up_no_darkness(tmp_path: Path) -> None:
    """On a rig of its own: the camera stays dead."""
    lit = LivePlan(rate_hz=5, pulse=PulsePair(current_a=CURRENT_A))
    with (
        open_rig(tiny_config(tmp_path / "runs", subnet=12)) as assembled,
        showing(assembled, tmp_path, lit) as (acquisition, _),
    ):
        assert assembled.laboratory is not None
        assembled.laboratory.inject(Fault(kind=FaultKind.KILLED, view="view2"))
        await_true(lambda: is_dark(assembled))
        status = acquisition.wait(DEADLINE_S)
        assert status.state is RunState.IDLE
        assert status.message.startswith("view2: ")
