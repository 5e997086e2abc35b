"""The live view of a rig in memory: what it shows, what ends it, and when the light goes off."""

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from daq.devices import GeneratorState
from daq.errors import BusyError, DeviceRefused, InterlockOpen, NotAcknowledged, PlanError
from daq.run.acquisition import Acquisition
from daq.run.events import RunEvent, RunMessage, RunStatus, StateChanged
from daq.run.limits import AcquisitionLimits
from daq.run.live import live_start
from daq.run.state import RunOutcome, RunState
from daq.run_plan import ImageKey, LivePlan, PulsePair, RunPlan
from daq.shot import Shot
from daq.timing import CameraTiming
from tests.support.memory_rig import DARK_COUNTS, LIT_COUNTS, MemoryRig

LIMITS = AcquisitionLimits(frame_s=0.1, light_off_s=0.2, disarm_s=0.3, drain_s=10, heartbeat_s=0.05)
DEADLINE_S = 20.0
PULSE = PulsePair(current_a={"view1": 20.0, "view2": 12.0})
LIT = LivePlan(rate_hz=10, pulse=PULSE)
SLOW = LivePlan(rate_hz=0.1, pulse=PULSE)
RUN = RunPlan(name="spray", shots=2, rate_hz=100, pulse=PULSE)


class Laboratory:
    """A rig, its acquisition, and every state that was told."""

    def __init__(self, data_dir: Path, limits: AcquisitionLimits = LIMITS) -> None:
        self.memory = MemoryRig()
        self.data_dir = data_dir
        self.told: list[RunEvent] = []
        self.acquisition = Acquisition(
            self.memory.rig, data_dir, self.told.append, limits=limits, observers=[self.memory]
        )

    def show(self, plan: LivePlan) -> Shot:
        """Start a live view and wait for a shot of it."""
        before = self.acquisition.newest_shot
        self.acquisition.start_live(plan)
        await_true(lambda: self.acquisition.newest_shot is not before)
        shot = self.acquisition.newest_shot
        assert shot is not None
        return shot

    def rest(self) -> RunStatus:
        status = self.acquisition.wait(DEADLINE_S)
        assert status.resting
        assert status.live is None
        return status

    def states(self) -> list[str]:
        return [event.state.value for event in self.told if isinstance(event, StateChanged)]


def await_true(condition: Callable[[], bool]) -> None:
    deadline, tick = time.monotonic() + DEADLINE_S, threading.Event()
    while not condition():
        assert time.monotonic() < deadline
        tick.wait(0.002)


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Laboratory]:
    laboratory = Laboratory(tmp_path / "runs")
    with laboratory.acquisition:
        yield laboratory
    assert laboratory.memory.generator.state is not GeneratorState.ARMED


def test_it_shows_both_exposures_lit_and_records_nothing(lab: Laboratory) -> None:
    first = lab.show(LIT)
    await_true(lambda: lab.acquisition.newest_shot is not first)
    second = lab.acquisition.newest_shot
    assert second is not None
    assert (first.index, second.index) == (0, 1)
    for view, counts in (("view1", DARK_COUNTS + LIT_COUNTS), ("view2", (DARK_COUNTS + LIT_COUNTS) << 4)):
        frames = second.views[view]
        assert np.median(frames.frame_a) == counts
        assert frames.frame_b is not None
        assert np.median(frames.frame_b) == counts
    status = lab.acquisition.status()
    assert (status.state, status.active, status.live, status.run_id) == (RunState.LIVE, False, LIT, None)
    assert not any(lab.data_dir.iterdir())


def test_ambient_light_is_none_of_ours(lab: Laboratory) -> None:
    shot = lab.show(LivePlan(rate_hz=10))
    assert np.median(shot.views["view1"].frame_a) == DARK_COUNTS
    assert shot.image_key is ImageKey.DARK
    assert lab.memory.journal[0] == "before dark"
    assert lab.memory.generator.counters["lights"] == 0


def test_ambient_light_needs_no_separation_even_of_a_camera_with_a_long_gap(lab: Laboratory) -> None:
    slow = CameraTiming(1000, 20_000, 100_000, 2_000_000, 0)
    for camera in lab.memory.cameras.values():
        camera.timing = slow
    assert lab.show(LivePlan(rate_hz=10)).index == 0
    with pytest.raises(PlanError, match="separation_ns: 6400 ns is below 101400 ns"):
        lab.acquisition.start_live(LIT)


def test_the_operator_ends_it_in_the_dark(lab: Laboratory) -> None:
    lab.show(SLOW)
    lab.acquisition.end_live()
    status = lab.rest()
    assert (status.state, status.message, status.outcome) == (RunState.IDLE, "ended by the operator", None)
    assert lab.states() == ["live", "idle"]
    journal = lab.memory.journal
    assert journal.index("off") < journal.index("view1 disarm")


def test_stop_and_leave_end_it_too(lab: Laboratory) -> None:
    lab.show(SLOW)
    lab.acquisition.stop()
    assert lab.rest().message == "stopped by the operator"
    lab.show(SLOW)
    lab.acquisition.leave("the server was ended")
    assert lab.rest().message == "the server was ended"
    with pytest.raises(BusyError, match="no run starts any more"):
        lab.acquisition.start_live(LIT)


@pytest.mark.parametrize(
    ("currents", "changes", "reason"),
    [
        ({"view1": 20.0, "view2": 26.5}, {}, "current_a: 26.5 A is above 26 A, the limit of the LED of view2"),
        ({"view1": 20.0}, {}, "names views"),
        ({"view1": 20.0, "view2": 12.0}, {"separation_ns": 2000}, "2000 ns is below"),
    ],
)
def test_light_that_a_run_may_not_have_is_refused_and_what_is_shown_goes_on(
    lab: Laboratory, currents: dict[str, float], changes: dict[str, int], reason: str
) -> None:
    plan = LivePlan(pulse=PulsePair(current_a=currents, **changes))
    with pytest.raises(PlanError, match=reason):
        lab.acquisition.start_live(plan)
    assert not lab.memory.journal
    lab.show(SLOW)
    with pytest.raises(PlanError, match=reason):
        lab.acquisition.start_live(plan)
    assert lab.acquisition.status().live == SLOW
    lab.acquisition.abort()
    assert lab.rest().message == "aborted by the operator"


def test_another_plan_takes_the_place_of_the_first(lab: Laboratory) -> None:
    lab.show(SLOW)
    dimmer = LivePlan(rate_hz=10, pulse=PulsePair(current_a={"view1": 5.0, "view2": 0.0}))
    shot = lab.show(dimmer)
    assert lab.acquisition.status().live == dimmer
    assert shot.fired is not None
    assert shot.fired.pulses["view1"][0].current_a == 5.0
    assert lab.states() == ["live", "idle", "live"]


def test_a_run_that_starts_ends_it_first(lab: Laboratory) -> None:
    lab.show(SLOW)
    lab.acquisition.start(RUN)
    assert lab.rest().outcome is RunOutcome.COMPLETED
    assert lab.states() == ["live", "idle", "arming", "acquiring", "disarming", "idle"]
    journal = lab.memory.journal
    assert journal.index("off") < journal.index("view1 disarm") < journal.index("arm 5")
    last = lab.acquisition.newest_shot
    assert last is not None
    assert last.index == 1


def test_a_run_that_is_refused_leaves_it_alone(lab: Laboratory) -> None:
    lab.show(SLOW)
    with pytest.raises(PlanError):
        lab.acquisition.start(RUN.model_copy(update={"references": ("gone",)}))
    assert lab.acquisition.status().state is RunState.LIVE
    lab.acquisition.end_live()
    assert lab.rest().message == "ended by the operator"


def test_it_is_refused_in_a_run_and_leaves_what_is_known_of_the_last_one(lab: Laboratory) -> None:
    run_id = lab.acquisition.start(RUN.model_copy(update={"shots": 50, "rate_hz": 0.2}))
    await_true(lambda: lab.acquisition.status().shots_recorded == 1)
    with pytest.raises(BusyError, match="live view is not possible: acquisition is acquiring"):
        lab.acquisition.start_live(LIT)
    lab.acquisition.end_live()
    assert lab.acquisition.status().active
    lab.acquisition.stop()
    lab.rest()
    lab.show(LIT)
    status = lab.acquisition.status()
    assert (status.run_id, status.outcome, status.active) == (run_id, RunOutcome.STOPPED, False)
    lab.acquisition.end_live()
    lab.rest()
    assert {event.run_id for event in lab.told[-2:] if isinstance(event, StateChanged)} == {""}


@pytest.mark.parametrize("which", ["door", "generator"])
def test_without_the_interlock_there_is_none(lab: Laboratory, which: str) -> None:
    if which == "door":
        lab.memory.interlock.open_door()
    lab.memory.generator.set_interlock(which != "generator")
    with pytest.raises(InterlockOpen, match=f"^{which}"):
        lab.acquisition.start_live(LIT)


@pytest.mark.parametrize("reason", ["abort", "door"])
def test_light_off_never_waits_for_a_frozen_camera(lab: Laboratory, reason: str) -> None:
    thaw = threading.Event()
    lab.memory.cameras["view1"].timing = CameraTiming(1000, 20_000, 2000, 3_000_000_000, 0)
    lab.memory.cameras["view1"].frozen = thaw
    try:
        lab.acquisition.start_live(SLOW)
        await_true(lambda: "fire 1" in lab.memory.journal)
        if reason == "abort":
            lab.acquisition.abort()
        else:
            lab.memory.interlock.open_door()
        await_true(lambda: "off" in lab.memory.journal)
        assert lab.memory.generator.state is not GeneratorState.ARMED
        assert lab.acquisition.status().state is RunState.LIVE
    finally:
        thaw.set()
    status = lab.rest()
    assert status.state is RunState.IDLE
    assert status.message == {"abort": "aborted by the operator", "door": "door: the interlock is open"}[reason]


def test_an_abort_while_a_run_waits_for_its_end_is_for_the_run_too(lab: Laboratory) -> None:
    thaw = threading.Event()
    lab.memory.cameras["view1"].timing = CameraTiming(1000, 20_000, 2000, 3_000_000_000, 0)
    lab.memory.cameras["view1"].frozen = thaw
    try:
        lab.acquisition.start_live(SLOW)
        await_true(lambda: "fire 1" in lab.memory.journal)
        starting = threading.Thread(target=lab.acquisition.start, args=(RUN.model_copy(update={"rate_hz": 0.1}),))
        starting.start()
        await_true(lambda: lab.acquisition._live_ending.step is not None)
        with pytest.raises(BusyError, match="another run or live view is being started"):
            lab.acquisition.start_live(LIT)
        lab.acquisition.abort()
    finally:
        thaw.set()
    starting.join(DEADLINE_S)
    status = lab.rest()
    assert (status.outcome, status.shots_recorded) == (RunOutcome.ABORTED, 0)
    assert lab.memory.generator.fired == 1


def test_a_dead_camera_ends_it_and_is_named(lab: Laboratory) -> None:
    lab.memory.cameras["view2"].broken_at = 2
    lab.show(LIT)
    status = lab.rest()
    assert (status.state, status.message) == (RunState.IDLE, "view2: control lost")
    assert lab.memory.generator.fired == 2


def test_nobody_waits_for_frames_once_something_ends_it_at_once(tmp_path: Path) -> None:
    """Cameras and generator are gone together: the guard hears it long before the deadline of the frames."""
    lab = Laboratory(tmp_path / "runs", AcquisitionLimits(frame_s=10 * DEADLINE_S, light_off_s=0.2, disarm_s=0.3))
    with lab.acquisition:
        lab.show(LIT)
        thaw = lab.memory.cameras["view1"].frozen = threading.Event()
        before = lab.memory.generator.fired
        await_true(lambda: lab.memory.generator.fired > before)
        lab.memory.open_door()
        status = lab.acquisition.wait(DEADLINE_S)
        thaw.set()
        lab.rest()
        assert status.resting
        assert "interlock" in status.message


def test_a_camera_that_is_not_disarmed_is_told(lab: Laboratory) -> None:
    lab.show(SLOW)
    thaw = lab.memory.cameras["view2"].frozen = threading.Event()
    lab.acquisition.end_live()
    status = lab.rest()
    thaw.set()
    assert status.message == "ended by the operator"
    (told,) = (event for event in lab.told if isinstance(event, RunMessage))
    assert (told.run_id, told.text) == ("", "view2: no answer to 'disarm' within 0.3 s")


def test_a_missing_exposure_is_shown_as_missing_and_ends_nothing(lab: Laboratory) -> None:
    lab.memory.cameras["view2"].lost = {1}
    shot = lab.show(SLOW)
    assert (shot.image_key, shot.views["view2"].record_b.valid) == (ImageKey.INVALID, False)
    assert lab.acquisition.status().state is RunState.LIVE
    assert lab.acquisition.status().message == "live view at 0.1 Hz, pulsed light"
    assert not [event for event in lab.told if isinstance(event, RunMessage)]


def test_a_generator_fault_ends_it_and_waits_to_be_acknowledged(lab: Laboratory) -> None:
    lab.show(SLOW)
    lab.memory.generator.trip("heartbeat")
    assert lab.rest().message == "generator: fault: heartbeat; acknowledge it first"
    with pytest.raises(DeviceRefused, match="heartbeat"):
        lab.acquisition.start_live(LIT)
    lab.acquisition.acknowledge()
    lab.show(LIT)


def test_two_causes_of_its_end_are_acknowledged_one_by_one(lab: Laboratory) -> None:
    lab.show(SLOW)
    lab.memory.generator.restarted = True
    lab.memory.open_door()
    assert len(lab.rest().to_acknowledge) == 2
    lab.memory.close_door()
    lab.acquisition.acknowledge()
    with pytest.raises(NotAcknowledged):
        lab.acquisition.start(RUN)
    lab.acquisition.acknowledge()
    lab.memory.generator.advance(1000)
    lab.show(LIT)


def test_a_refusal_to_fire_is_told_by_its_reason(tmp_path: Path) -> None:
    """The guard has not looked yet: the shot is the first to meet a generator that went off by itself."""
    lab = Laboratory(tmp_path / "runs", AcquisitionLimits(frame_s=0.1, heartbeat_s=5.0))
    with lab.acquisition:
        lab.show(LIT)
        lab.memory.generator.trip("interlock")
        await_true(lambda: lab.acquisition._live_ending.step is not None)
        lab.memory.interlock.open_door()  # ends the wait of the guard
        assert lab.rest().message == "generator: fault: interlock; acknowledge it first"


def test_cameras_are_disarmed_while_the_light_is_still_being_confirmed_off(tmp_path: Path) -> None:
    """A generator and cameras that are all dead cost the longest of their deadlines, not all of them."""
    lab = Laboratory(tmp_path / "runs", AcquisitionLimits(frame_s=0.1, light_off_s=DEADLINE_S))
    with lab.acquisition:
        lab.show(SLOW)
        lab.memory.generator.stuck = True
        lab.acquisition.end_live()
        await_true(lambda: {"view1 disarm", "view2 disarm"} <= set(lab.memory.journal))
        assert lab.acquisition.status().state is RunState.LIVE
        lab.memory.generator.stuck = False
        assert lab.rest().state is RunState.IDLE


def test_light_that_does_not_go_off_is_a_fault(lab: Laboratory) -> None:
    lab.show(SLOW)
    lab.memory.generator.stuck = True
    with pytest.raises(BusyError, match="start is not possible: acquisition is fault"):
        lab.acquisition.start(RUN)
    status = lab.rest()
    assert status.state is RunState.FAULT
    assert "light not confirmed off: generator: still armed after off" in status.message
    lab.memory.generator.stuck = False
    lab.acquisition.acknowledge()
    lab.show(LIT)


def test_a_fault_of_the_live_view_is_no_matter_of_the_run_before_it(lab: Laboratory) -> None:
    lab.acquisition.start(RUN)
    lab.rest()
    lab.show(SLOW)
    lab.memory.generator.stuck = True
    lab.acquisition.end_live()
    lab.rest()
    lab.memory.generator.stuck = False
    lab.acquisition.acknowledge()
    told = lab.told[-1]
    assert isinstance(told, StateChanged)
    assert (told.run_id, told.state, told.outcome) == ("", RunState.IDLE, None)


def test_it_ends_when_nobody_looks_and_not_before(tmp_path: Path) -> None:
    lab = Laboratory(tmp_path / "runs", AcquisitionLimits(frame_s=0.1, heartbeat_s=0.05, live_unwatched_s=0.5))
    with lab.acquisition:
        threading.Event().wait(0.6)  # nobody need have looked before it starts
        first = lab.show(LIT)
        began = time.monotonic()
        while time.monotonic() < began + 1.0:
            lab.acquisition.keep_live()
            threading.Event().wait(0.02)
        assert lab.acquisition.status().state is RunState.LIVE
        status = lab.rest()
    assert (status.state, status.message) == (RunState.IDLE, "nobody has looked at the live view for 0.5 s")
    assert lab.acquisition.newest_shot is not first


def test_the_generator_is_armed_again_for_the_next_shots(lab: Laboratory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_start, "SHOTS_PER_ARMING", 2)
    lab.show(LIT)
    await_true(lambda: lab.memory.generator.fired == 5)
    assert [entry for entry in lab.memory.journal if entry.startswith("arm")] == ["arm 2"] * 3
