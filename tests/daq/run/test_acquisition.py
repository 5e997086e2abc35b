"""Runs on a rig in memory: how they end, what is on the disk then, and when the light goes off."""

import errno
import re
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from daq.causes import CauseCode
from daq.devices import DeviceIdentity, GeneratorState, GeneratorStatus, Rig
from daq.errors import (
    BusyError,
    DaqError,
    DeviceError,
    DeviceOvertaken,
    DeviceRefused,
    DeviceTimeout,
    InterlockOpen,
    NotAcknowledged,
    PlanError,
)
from daq.files.recovery import INTERRUPTED_CAUSE
from daq.files.run_directory import ImageKey, PulsePair, RunKind, RunPlan, RunReader, RunWriter
from daq.network import Network
from daq.run.acquisition import Acquisition
from daq.run.events import RunEvent, RunMessage, ShotRecorded, StateChanged, Waiting
from daq.run.limits import AcquisitionLimits
from daq.run.state import RunOutcome, RunState
from daq.run_plan import LivePlan
from daq.shot import FiredTrain
from daq.timing import CameraTiming
from tests.support.memory_rig import DARK_COUNTS, LIT_COUNTS, MemoryRig

LIMITS = AcquisitionLimits(frame_s=0.1, light_off_s=0.2, disarm_s=0.3, drain_s=10, heartbeat_s=0.05)
DEADLINE_S = 20.0


class Laboratory:
    """A rig, its acquisition, and everything that was published."""

    def __init__(self, data_dir: Path) -> None:
        self.memory = MemoryRig()
        self.data_dir = data_dir
        self.events: list[RunEvent] = []
        self.acquisition = Acquisition(
            self.memory.rig,
            data_dir,
            self._publish,
            {"name": "in memory"},
            lambda name: f"sha of {name}",
            LIMITS,
            [self.memory],
        )
        self._recorded = threading.Condition()

    def _publish(self, event: RunEvent) -> None:
        with self._recorded:
            self.events.append(event)
            self._recorded.notify_all()

    def run(self, plan: RunPlan) -> RunReader:
        run_id = self.acquisition.start(plan)
        assert not self.acquisition.wait(DEADLINE_S).active
        return RunReader(self.data_dir / run_id)

    def start_and_await_shot(self, plan: RunPlan, index: int) -> RunReader:
        run_id = self.acquisition.start(plan)
        with self._recorded:
            assert self._recorded.wait_for(
                lambda: any(isinstance(event, ShotRecorded) and event.index == index for event in self.events),
                DEADLINE_S,
            )
        return RunReader(self.data_dir / run_id)

    def await_in_journal(self, entry: str) -> None:
        deadline = time.monotonic() + DEADLINE_S
        tick = threading.Event()
        while entry not in self.memory.journal:
            assert time.monotonic() < deadline, entry
            tick.wait(0.002)

    def messages(self) -> str:
        return "\n".join(event.text for event in self.events if isinstance(event, RunMessage))


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Laboratory]:
    laboratory = Laboratory(tmp_path / "runs")
    with laboratory.acquisition:
        yield laboratory
    assert laboratory.memory.generator.state is not GeneratorState.ARMED


def plan_of(shots: int = 4, rate_hz: float = 100, **changes: Any) -> RunPlan:
    fields: dict[str, Any] = {
        "name": "hollow cone",
        "shots": shots,
        "rate_hz": rate_hz,
        "pulse": PulsePair(current_a={"view1": 20.0, "view2": 12.0}),
        **changes,
    }
    return RunPlan.model_validate(fields)


SLOW: dict[str, Any] = {"shots": 50, "rate_hz": 0.2}


def test_a_run_is_on_the_disk_with_all_that_explains_it(lab: Laboratory) -> None:
    reader = lab.run(plan_of(calibration="c7"))
    status = lab.acquisition.status()
    assert (status.state, status.outcome) == (RunState.IDLE, RunOutcome.COMPLETED)
    assert (status.shots_planned, status.shots_recorded, status.shots_valid) == (4, 4, 4)
    assert (reader.outcome, reader.cause, reader.shot_count) == ("completed", "", 4)
    assert reader.image_keys().tolist() == [0, 0, 0, 0]
    header = reader.header
    assert header.plan == plan_of(calibration="c7")
    assert header.configuration == {"name": "in memory"}
    assert header.calibration_sha256 == "sha of c7"
    assert set(header.devices) == {"view1", "view2", "generator", "door", "stage"}
    shot = reader.read_shot(2)
    assert shot.fired is not None
    pulses = shot.fired.pulses["view2"]
    assert pulses[1].start_ns - pulses[0].start_ns == 6400
    assert (shot.fired.sequence, pulses[0].current_a, shot.stage_z_mm) == (3, 12.0, None)
    assert np.median(shot.views["view2"].frame_a) == (DARK_COUNTS + LIT_COUNTS) << 4
    assert abs(shot.host_time_ns - time.time_ns()) < 60e9


def test_events_tell_the_run_in_order(lab: Laboratory) -> None:
    lab.run(plan_of(2))
    told = [event.state.value if isinstance(event, StateChanged) else event for event in lab.events]
    states = [entry for entry in told if isinstance(entry, str)]
    assert states == ["arming", "acquiring", "disarming", "idle"]
    assert [event.index for event in lab.events if isinstance(event, ShotRecorded)] == [0, 1]
    last = lab.events[-1]
    assert isinstance(last, StateChanged)
    assert (last.outcome, last.message) == (RunOutcome.COMPLETED, "2 of 2 shots recorded, 2 valid")


def test_runs_follow_each_other_and_never_share_a_directory(lab: Laboratory) -> None:
    readers = [lab.run(plan_of(1)) for _ in range(3)]
    assert [reader.outcome for reader in readers] == ["completed"] * 3
    names = [reader.run_dir.name for reader in readers]
    assert len(set(names)) == 3
    assert names == sorted(names)
    assert all(name.split("-", 1)[1].startswith("hollow_cone") for name in names)


def test_no_shot_comes_before_its_time(lab: Laboratory) -> None:
    """Cameras ignore an early trigger, the generator refuses it; a late shot may shorten the time to the next one."""
    reader = lab.run(plan_of(6, rate_hz=25))
    times_s = np.array([reader.read_shot(index).host_time_ns for index in range(6)]) / 1e9
    assert np.all(times_s - times_s[0] > np.arange(6) / 25 - 0.001)
    assert np.all(np.diff(times_s) > 0.5 / 25 - 0.001)
    assert times_s[-1] - times_s[0] < 3


def test_the_light_goes_off_before_the_cameras(lab: Laboratory) -> None:
    lab.run(plan_of(1))
    journal = lab.memory.journal
    assert journal[:4] == ["before sample", "view1 arm", "view2 arm", "arm 4"]
    assert journal.index("off") < journal.index("view1 disarm")


def test_dark_and_background_runs_make_a_sample_run_complete(lab: Laboratory) -> None:
    dark = lab.run(plan_of(3, kind=RunKind.DARK))
    background = lab.run(plan_of(2, kind=RunKind.BACKGROUND))
    assert dark.image_keys().tolist() == [ImageKey.DARK] * 3
    assert background.image_keys().tolist() == [ImageKey.BACKGROUND] * 2
    shot = dark.read_shot(0)
    assert shot.fired is not None
    assert not any(shot.fired.pulses.values())
    sample = lab.run(plan_of(1, references=(dark.run_dir.name, background.run_dir.name)))
    for reader, stored in ((dark, sample.dark), (background, sample.background)):
        for view in ("view1", "view2"):
            shots = [reader.read_shot(index).views[view] for index in range(reader.shot_count)]
            frames = [(shot.frame_a, np.asarray(shot.frame_b)) for shot in shots]
            expected = np.mean(np.array(frames, np.float64), axis=0)
            found = stored(view)
            assert found is not None
            np.testing.assert_allclose(found, expected, rtol=1e-6)
    assert sample.image_keys().tolist() == [ImageKey.SAMPLE]


def test_a_lost_frame_is_fired_again(lab: Laboratory) -> None:
    lab.memory.cameras["view2"].lost = {2, 3}
    reader = lab.run(plan_of(4, refire_quota=2))
    assert reader.image_keys().tolist() == [0, 0, 0, 0]
    fired = [reader.read_shot(index).fired for index in range(4)]
    assert [train.sequence for train in fired if train] == [1, 4, 5, 6]
    assert "shot 1: no exposure B of view2" in lab.messages()


def test_beyond_the_quota_a_lost_frame_keeps_its_slot(lab: Laboratory) -> None:
    lab.memory.cameras["view2"].lost = {2, 3, 5}
    reader = lab.run(plan_of(5, refire_quota=1))
    assert reader.image_keys().tolist() == [0, ImageKey.INVALID, 0, ImageKey.INVALID, 0]
    shot = reader.read_shot(1)
    assert shot.index == 1
    lost = shot.views["view2"]
    assert (lost.record_a.valid, lost.record_b.valid, shot.views["view1"].valid) == (True, False, True)
    assert lost.frame_b is not None
    assert not lost.frame_b.any()
    status = lab.acquisition.status()
    assert (status.outcome, status.shots_recorded, status.shots_valid) == (RunOutcome.COMPLETED, 5, 3)
    faults = [(event.index, event.fault) for event in lab.events if isinstance(event, ShotRecorded) and event.fault]
    assert faults == [(1, "no exposure B of view2"), (3, "no exposure B of view2")]


def test_a_lost_pulse_is_flagged_and_not_taken_for_a_lost_frame(lab: Laboratory) -> None:
    lab.memory.generator.unlit = {2}
    reader = lab.run(plan_of(3))
    assert reader.image_keys().tolist() == [0, ImageKey.INVALID, 0]
    assert lab.memory.generator.fired == 3
    assert "shot 1: no light in B of view1, no light in B of view2" in lab.messages()


@pytest.mark.parametrize("lost", ["light", "frames"])
def test_five_invalid_shots_in_a_row_end_the_run_and_are_kept(lab: Laboratory, lost: str) -> None:
    fired = set(range(3, 100))
    if lost == "light":
        lab.memory.generator.unlit = fired
    else:
        lab.memory.cameras["view2"].lost = fired
    reader = lab.run(plan_of(20, refire_quota=0))
    what = "no light in B of view1, no light in B of view2" if lost == "light" else "no exposure B of view2"
    cause = f"5 shots in a row are invalid; shot 6: {what}"
    assert (reader.outcome, reader.cause) == ("failed", cause)
    assert [cause.code for cause in reader.causes] == [CauseCode.INVALID_SHOTS]
    assert reader.image_keys().tolist() == [0, 0] + 5 * [ImageKey.INVALID]
    assert lab.memory.generator.fired == 7
    assert lab.memory.journal.index("off") < lab.memory.journal.index("view1 disarm")


def test_a_valid_shot_ends_the_row_of_invalid_ones(lab: Laboratory) -> None:
    lab.memory.generator.unlit = {1, 2, 3, 4, 6, 7, 8, 9}
    assert lab.run(plan_of(10)).outcome == "completed"


def test_a_run_without_a_valid_shot_is_never_completed(lab: Laboratory) -> None:
    lab.memory.cameras["view2"].lost = {1, 2, 3}
    reader = lab.run(plan_of(3, refire_quota=0))
    assert (reader.outcome, reader.cause) == ("failed", "none of 3 shots is valid; shot 2: no exposure B of view2")
    assert lab.acquisition.status().outcome is RunOutcome.FAILED
    assert reader.shot_count == 3


def test_a_view_without_current_may_be_dark(lab: Laboratory) -> None:
    reader = lab.run(plan_of(2, pulse=PulsePair(current_a={"view1": 20.0, "view2": 0.0})))
    assert reader.image_keys().tolist() == [0, 0]


def test_a_target_is_taken_at_each_position_and_light_waits_for_the_stage(lab: Laboratory) -> None:
    reader = lab.run(plan_of(2, kind=RunKind.CALIBRATION, stage_z_mm=(-3.0, 0.0, 3.0)))
    shots = [reader.read_shot(index) for index in range(6)]
    assert [shot.stage_z_mm for shot in shots] == [-2.999, -2.999, 0.001, 0.001, 3.001, 3.001]
    acted = [entry for entry in lab.memory.journal if entry.startswith(("move", "arm"))]
    assert acted == ["move -3", "arm 5", "move 0", "arm 5", "move 3", "arm 5"]


def test_a_stage_that_is_silent_ends_only_the_runs_that_move_it(lab: Laboratory) -> None:
    lab.memory.stage.mute = True
    reader = lab.run(plan_of(2))
    assert (reader.outcome, reader.shot_count) == ("completed", 2)
    assert "not answered" in reader.header.devices["stage"]
    moved = lab.run(plan_of(1, kind=RunKind.CALIBRATION, stage_z_mm=(1.0,)))
    assert (moved.outcome, moved.cause) == ("failed", "stage: no answer to 'identity' within 0.5 s")


def assert_failed(lab: Laboratory, reader: RunReader, cause: str, readable: int) -> None:
    status = lab.acquisition.wait(DEADLINE_S)
    assert (status.state, status.outcome) == (RunState.IDLE, RunOutcome.FAILED)
    assert cause in status.message
    assert (reader.outcome, reader.cause) == ("failed", status.message)
    assert reader.shot_count == readable
    assert all(reader.read_shot(index).valid for index in range(readable))
    journal = lab.memory.journal
    assert journal.index("off") < journal.index("view1 disarm")


def test_a_dead_camera_fails_the_run_and_keeps_its_shots(lab: Laboratory) -> None:
    lab.memory.cameras["view2"].broken_at = 3
    assert_failed(lab, lab.run(plan_of(9)), "view2: control lost", 2)
    assert lab.memory.generator.fired == 3


def test_a_run_whose_camera_does_not_say_who_it_is_has_a_directory_with_the_reason(lab: Laboratory) -> None:
    lab.memory.cameras["view2"].mute = True
    reader = lab.run(plan_of())
    assert_failed(lab, reader, "view2: no answer to 'identity' within 0.5 s", 0)
    devices = reader.header.devices
    assert devices["view2"] == {"not answered": "no answer to 'identity' within 0.5 s"}
    assert devices["view1"]["vendor"] == devices["generator"]["vendor"] == "tomoshadow"
    assert reader.ended_utc > reader.header.created_utc


def test_an_accepted_run_has_a_directory_before_any_device_is_asked(lab: Laboratory) -> None:
    found: list[str] = []

    def look(_: str) -> DeviceIdentity:
        found.extend(path.parent.name for path in lab.data_dir.glob("*/run.h5"))
        raise DeviceTimeout("view1", "identity", 0.5)

    lab.memory.cameras["view1"].identity = partial(look, "")  # type: ignore[method-assign]
    assert lab.run(plan_of()).run_dir.name in found


@pytest.mark.parametrize("sequence", [1, 3, 4])
@pytest.mark.parametrize("quota", [0, 3])
def test_a_silent_camera_costs_the_light_before_it_is_asked(lab: Laboratory, sequence: int, quota: int) -> None:
    lab.memory.cameras["view2"].dead_from = sequence
    assert_failed(lab, lab.run(plan_of(4, refire_quota=quota)), "view2: does not answer", sequence - 1)
    journal = lab.memory.journal
    fired = journal.index(f"fire {sequence}")
    assert journal[fired + 1 : fired + 3] == ["off", "view2 ask"]


def test_a_camera_that_missed_a_trigger_goes_on_with_the_light_armed_again(lab: Laboratory) -> None:
    lab.memory.cameras["view2"].silent_at = {2}
    reader = lab.run(plan_of(4, refire_quota=3))
    assert (reader.outcome, reader.shot_count) == ("completed", 4)
    journal = lab.memory.journal
    assert journal[journal.index("fire 2") :][:5] == ["fire 2", "off", "view2 ask", "arm 5", "fire 3"]
    assert "shot 1: nothing came from view2; light off" in lab.messages()


def test_a_camera_that_misses_the_last_trigger_arms_nothing_again(lab: Laboratory) -> None:
    lab.memory.cameras["view2"].silent_at = {2}
    reader = lab.run(plan_of(2, refire_quota=0))
    assert reader.shot_count == 2
    assert [entry for entry in lab.memory.journal if entry.startswith("arm")] == ["arm 2"]


def test_the_light_does_not_wait_for_the_clock_of_a_camera(lab: Laboratory) -> None:
    run_id = lab.acquisition.start(plan_of(3, rate_hz=5))
    lab.await_in_journal("fire 1")
    lab.memory.cameras["view1"].clock = clock = threading.Event()
    lab.await_in_journal("off")
    assert lab.memory.generator.state is GeneratorState.SAFE
    assert lab.acquisition.status().active
    clock.set()
    assert lab.acquisition.wait(DEADLINE_S).outcome is RunOutcome.COMPLETED
    assert RunReader(lab.data_dir / run_id).shot_count == 3


def test_a_camera_whose_clock_stands_still_is_named(lab: Laboratory) -> None:
    reader = lab.start_and_await_shot(plan_of(9, rate_hz=5), 0)
    lab.memory.cameras["view1"].clock = clock = threading.Event()
    assert not lab.acquisition.wait(DEADLINE_S).active
    clock.set()
    assert "view1: no answer to 'begin shot' within" in reader.cause
    assert reader.outcome == "failed"


def test_a_stop_while_it_is_dark_is_a_stop(lab: Laboratory) -> None:
    reader = lab.start_and_await_shot(plan_of(3, rate_hz=5), 0)
    lab.memory.cameras["view1"].clock = clock = threading.Event()
    lab.await_in_journal("off")
    lab.acquisition.stop()
    clock.set()
    assert lab.acquisition.wait(DEADLINE_S).outcome is RunOutcome.STOPPED
    assert reader.shot_count < 3


def test_a_failed_fire_is_no_lost_frame(lab: Laboratory) -> None:
    lab.memory.generator.silent_at = 2
    assert_failed(lab, lab.run(plan_of(9)), "generator: no answer to 'fire' within 0.5 s", 1)
    assert lab.memory.generator.fired == 2


def test_a_generator_that_loads_something_else_never_fires(lab: Laboratory) -> None:
    lab.memory.generator.wrong_echo_ns = 100
    assert_failed(lab, lab.run(plan_of()), "start of pulse 1 of view1 is 6500 ns instead of 6400 ns", 0)
    assert lab.memory.generator.fired == 0


def test_a_generator_fault_ends_the_wait_for_the_next_shot(lab: Laboratory) -> None:
    reader = lab.start_and_await_shot(plan_of(**SLOW), 0)
    lab.memory.generator.trip("heartbeat")
    assert_failed(lab, reader, "generator: fault: heartbeat", 1)
    with pytest.raises(DeviceRefused, match="heartbeat; acknowledge it first"):
        lab.acquisition.start(plan_of())
    lab.acquisition.acknowledge()
    assert lab.run(plan_of(1)).outcome == "completed"


def test_a_shot_that_cannot_be_stored_fails_the_run(lab: Laboratory) -> None:
    reader = lab.start_and_await_shot(plan_of(1000, rate_hz=10), 0)
    for index in range(10, 40):
        path = reader.run_dir / "shots" / f"{index}.h5"
        if not path.exists():
            path.mkdir()
    status = lab.acquisition.wait(DEADLINE_S)
    assert status.outcome is RunOutcome.FAILED
    assert "exists already" in status.message
    assert reader.outcome == "failed"


def test_an_open_door_darkens_at_once_and_names_the_reason(lab: Laboratory) -> None:
    reader = lab.start_and_await_shot(plan_of(**SLOW), 0)
    lab.memory.interlock.open_door()
    assert_failed(lab, reader, "door: the interlock is open", 1)


@pytest.fixture
def frozen(lab: Laboratory) -> Iterator[threading.Event]:
    """A camera that hangs in collect and in disarm until the end of the test."""
    thaw = threading.Event()
    lab.memory.cameras["view1"].timing = CameraTiming(1000, 20_000, 2000, 3_000_000_000, 0)
    lab.memory.cameras["view1"].frozen = thaw
    yield thaw
    thaw.set()


def test_what_a_run_waits_for_is_told(lab: Laboratory, frozen: threading.Event) -> None:
    lab.acquisition.start(plan_of(rate_hz=0.1))
    lab.await_in_journal("fire 1")
    waiting = await_waiting(lab, "view1: ")
    assert waiting.text == "view1: exposures A and B of shot 0"
    assert 0 <= time.monotonic() - waiting.since_s < DEADLINE_S
    lab.memory.cameras["view1"].has_half = True
    assert await_waiting(lab, "second").text == "view1: the second exposure of shot 0"
    lab.acquisition.abort()
    frozen.set()
    assert lab.acquisition.wait(DEADLINE_S).waiting is None


def test_a_slow_run_waits_for_the_time_of_its_next_shot(lab: Laboratory) -> None:
    lab.start_and_await_shot(plan_of(**SLOW), 0)
    assert await_waiting(lab, "shot 1").text == "the time of shot 1"
    lab.acquisition.abort()


def await_waiting(lab: Laboratory, word: str) -> Waiting:
    deadline, tick = time.monotonic() + DEADLINE_S, threading.Event()
    while True:
        waiting = lab.acquisition.status().waiting
        if waiting is not None and word in waiting.text:
            return waiting
        assert time.monotonic() < deadline, waiting
        tick.wait(0.002)


@pytest.mark.parametrize("reason", ["abort", "door"])
def test_light_off_never_waits_for_a_frozen_camera(lab: Laboratory, frozen: threading.Event, reason: str) -> None:
    run_id = lab.acquisition.start(plan_of(rate_hz=0.1))
    lab.await_in_journal("fire 1")
    began = time.monotonic()
    if reason == "abort":
        lab.acquisition.abort()
    else:
        lab.memory.interlock.open_door()
    lab.await_in_journal("off")
    assert time.monotonic() - began < 0.5
    assert lab.memory.generator.state is GeneratorState.SAFE
    assert lab.acquisition.status().active
    frozen.set()
    status = lab.acquisition.wait(DEADLINE_S)
    assert status.outcome is (RunOutcome.ABORTED if reason == "abort" else RunOutcome.FAILED)
    reader = RunReader(lab.data_dir / run_id)
    assert (reader.outcome, reader.unstored) == (status.outcome, (0,)), "the shot under way was fired, and is lost"


def test_a_frozen_camera_is_left_alone_after_its_deadline(lab: Laboratory) -> None:
    reader = lab.start_and_await_shot(plan_of(**SLOW), 0)
    thaw = lab.memory.cameras["view2"].frozen = threading.Event()
    lab.acquisition.stop()
    status = lab.acquisition.wait(2.0)
    thaw.set()
    assert status.outcome is RunOutcome.STOPPED
    assert "view2: no answer to 'disarm' within 0.3 s" in lab.messages()
    assert reader.outcome == "stopped"


def test_a_stop_ends_the_wait_and_completes_the_shot(lab: Laboratory) -> None:
    reader = lab.start_and_await_shot(plan_of(**SLOW), 0)
    lab.acquisition.stop()
    status = lab.acquisition.wait(2.0)
    assert (status.state, status.outcome, status.shots_recorded) == (RunState.IDLE, RunOutcome.STOPPED, 1)
    assert (reader.outcome, reader.cause) == ("stopped", "stopped by the operator")


def test_an_abort_between_shots_is_an_abort_and_no_failure(lab: Laboratory) -> None:
    reader = lab.start_and_await_shot(plan_of(1000, rate_hz=10), 2)
    lab.acquisition.abort()
    status = lab.acquisition.wait(DEADLINE_S)
    assert (status.state, status.outcome) == (RunState.IDLE, RunOutcome.ABORTED)
    assert reader.outcome == "aborted"
    assert reader.shot_count == status.shots_recorded >= 3


def test_light_that_does_not_go_off_is_a_fault_until_acknowledged(lab: Laboratory) -> None:
    lab.memory.generator.stuck = True
    reader = lab.run(plan_of(1))
    status = lab.acquisition.status()
    assert (status.state, status.outcome) == (RunState.FAULT, RunOutcome.FAILED)
    assert status.message == "light not confirmed off: generator: still armed after off"
    assert reader.cause == status.message
    with pytest.raises(BusyError, match="acquisition is fault"):
        lab.acquisition.start(plan_of())
    with pytest.raises(DeviceError, match="still armed"):
        lab.acquisition.acknowledge()
    assert lab.acquisition.status().state is RunState.FAULT
    lab.memory.generator.stuck = False
    lab.acquisition.acknowledge()
    assert lab.run(plan_of(1)).outcome == "completed"


def test_only_one_run_at_a_time(lab: Laboratory) -> None:
    lab.start_and_await_shot(plan_of(**SLOW), 0)
    with pytest.raises(BusyError, match="start is not possible: acquisition is acquiring"):
        lab.acquisition.start(plan_of())
    with pytest.raises(BusyError, match="acknowledge is not possible"):
        lab.acquisition.acknowledge()
    lab.acquisition.abort()
    assert lab.acquisition.wait(DEADLINE_S).outcome is RunOutcome.ABORTED


REFUSALS: dict[str, tuple[dict[str, Any], type[DaqError], str]] = {
    "views": ({"pulse": PulsePair(current_a={"view1": 1.0})}, PlanError, "pulse.current_a names views"),
    "rate": ({"pulse": PulsePair(current_a={"view1": 1.0, "view2": 1.0}, separation_ns=2000)}, PlanError, "2000 ns"),
    "current": (
        {"pulse": PulsePair(current_a={"view1": 30.0, "view2": 26.5})},
        PlanError,
        "pulse.current_a: 26.5 A is above 26 A, the limit of the LED of view2",
    ),
    "position": ({"stage_z_mm": (0.0, 11.0)}, PlanError, "11 mm is outside of -10 to 10 mm"),
    "reference": ({"references": ("../secret",)}, PlanError, r"no run '\.\./secret'"),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_an_impossible_plan_is_refused_with_its_reason(lab: Laboratory, case: str) -> None:
    changes, error, reason = REFUSALS[case]
    with pytest.raises(error, match=reason):
        lab.acquisition.start(plan_of(**changes))
    assert lab.acquisition.status().state is RunState.IDLE
    assert not lab.memory.journal
    assert lab.run(plan_of(1)).outcome == "completed"


def test_a_run_that_the_disk_does_not_hold_is_refused_with_both_numbers(lab: Laboratory) -> None:
    lab.memory.cameras["view1"].image_shape = (60_000, 60_000)
    with pytest.raises(
        PlanError, match=r"100000 shots of \d+ bytes, in all \d+ bytes, do not fit the disk of .*: \d+ bytes are free"
    ):
        lab.acquisition.start(plan_of(100_000))


def test_images_that_come_faster_than_the_wires_carry_them_are_refused(lab: Laboratory) -> None:
    """A shot has 2 x (768 + 2 x 640) bytes and four packets with 74 bytes around each: 35 kbit."""
    shared = replace(lab.memory.rig, network=Network(camera_gbit_s=1e-3, shared_gbit_s=1e-3))
    acquisition = Acquisition(shared, lab.data_dir)
    with pytest.raises(
        PlanError, match=r"rate_hz: 50 shots .* pass through the 0\.001 Gbit/s .* at most 28\.5 per second"
    ):
        acquisition.start(plan_of(1, rate_hz=50))
    assert not lab.memory.journal
    acquisition.start(plan_of(1, rate_hz=25))
    assert acquisition.wait(DEADLINE_S).outcome is RunOutcome.COMPLETED


def test_a_calibration_that_does_not_exist_refuses_the_plan(lab: Laboratory) -> None:
    acquisition = Acquisition(
        lab.memory.rig, lab.data_dir, hash_calibration=lambda name: (lab.data_dir / name).read_text()
    )
    with pytest.raises(PlanError, match=r"No such file.*c9"):
        acquisition.start(plan_of(calibration="c9"))
    assert not acquisition.status().active


def test_a_rig_without_a_stage_refuses_positions(lab: Laboratory) -> None:
    rig = lab.memory.rig
    acquisition = Acquisition(Rig(rig.cameras, rig.generator, rig.interlock), lab.data_dir)
    with pytest.raises(PlanError, match="no translation stage"):
        acquisition.start(plan_of(stage_z_mm=(0.0,)))


def test_only_dark_and_background_runs_of_this_rig_are_references(lab: Laboratory) -> None:
    sample = lab.run(plan_of(1))
    with pytest.raises(PlanError, match="is sample, not dark or background"):
        lab.acquisition.start(plan_of(references=(sample.run_dir.name,)))
    lab.memory.generator.unlit = {2}
    unlit = lab.run(plan_of(1, kind=RunKind.BACKGROUND))
    with pytest.raises(PlanError, match="has no valid shot"):
        lab.acquisition.start(plan_of(references=(unlit.run_dir.name,)))
    dark = lab.run(plan_of(1, kind=RunKind.DARK))
    lab.memory.cameras["view1"].image_shape = (8, 8)
    own, ours = r"view1 \(32 x 24 px, 8 bit\)", r"view1 \(8 x 8 px, 8 bit\)"
    same = r"view2 \(40 x 16 px, 12 bit\)"
    with pytest.raises(PlanError, match=f"has views {own}, {same}; the rig has {ours}, {same}$"):
        lab.acquisition.start(plan_of(references=(dark.run_dir.name,)))


@pytest.mark.parametrize(
    ("pulse", "difference"),
    [
        ({"current_a": {"view1": 20.0, "view2": 6.0}}, r"current of view2 12\.0 A instead of 6\.0 A$"),
        ({"current_a": {"view1": 20.0, "view2": 12.0}, "width_ns": 500}, "pulse width 1000 ns instead of 500 ns$"),
    ],
)
def test_a_background_that_was_lit_otherwise_is_refused_with_the_difference(
    lab: Laboratory, pulse: dict[str, Any], difference: str
) -> None:
    background = lab.run(plan_of(1, kind=RunKind.BACKGROUND)).run_dir.name
    with pytest.raises(PlanError, match=difference):
        lab.acquisition.start(plan_of(references=(background,), pulse=PulsePair(**pulse)))


@pytest.mark.parametrize("kind", [RunKind.DARK, RunKind.BACKGROUND])
def test_a_reference_of_another_camera_at_the_same_place_ends_the_run_before_there_is_light(
    lab: Laboratory, kind: RunKind
) -> None:
    reference = lab.run(plan_of(1, kind=kind)).run_dir.name
    lab.memory.cameras["view2"].serial = "77"
    lab.memory.journal.clear()
    run = lab.run(plan_of(1, references=(reference,)))
    assert (run.outcome, run.shot_count) == (RunOutcome.FAILED, 0)
    assert f"{reference} was recorded by tomoshadow memory view2, and this is tomoshadow memory 77" in run.cause
    assert run.cause.startswith("view2: ")
    assert not any("fire" in entry for entry in lab.memory.journal)
    lab.memory.cameras["view2"].serial = "view2"
    assert lab.run(plan_of(1, references=(reference,))).outcome == RunOutcome.COMPLETED


def test_the_separation_of_the_pulses_and_the_light_of_a_dark_run_do_not_matter(lab: Laboratory) -> None:
    dark, background = (lab.run(plan_of(1, kind=kind)).run_dir.name for kind in (RunKind.DARK, RunKind.BACKGROUND))
    pulse = PulsePair(current_a={"view1": 20.0, "view2": 12.0}, separation_ns=20_000)
    dimmer = PulsePair(current_a={"view1": 20.0, "view2": 6.0})
    for references, pulses in (((dark, background), pulse), ((dark,), dimmer)):
        lab.run(plan_of(1, references=references, pulse=pulses))
        assert lab.acquisition.status().outcome is RunOutcome.COMPLETED


def test_a_reference_that_was_not_completed_is_refused_with_its_outcome(lab: Laboratory) -> None:
    lab.acquisition.start(plan_of(50, rate_hz=10, kind=RunKind.DARK))
    while not lab.acquisition.status().shots_recorded:
        threading.Event().wait(0.01)
    lab.acquisition.stop()
    dark = lab.acquisition.wait(DEADLINE_S).run_id
    with pytest.raises(PlanError, match=f"{dark}' is stopped, not completed: stopped by the operator"):
        lab.acquisition.start(plan_of(references=(str(dark),)))


@pytest.mark.parametrize("which", ["door", "generator"])
def test_no_light_while_an_interlock_is_open(lab: Laboratory, which: str) -> None:
    if which == "door":
        lab.memory.interlock.open_door()
    lab.memory.generator.set_interlock(which != "generator")
    with pytest.raises(InterlockOpen, match=f"^{which}"):
        lab.acquisition.start(plan_of())
    assert not lab.memory.journal


def test_the_guard_asks_again_when_the_light_goes_off_under_its_question(
    lab: Laboratory, monkeypatch: pytest.MonkeyPatch
) -> None:
    generator, overtaken = lab.memory.generator, threading.Event()
    status = generator.status

    def overtaken_once() -> GeneratorStatus:
        if threading.current_thread().name == "run-guard" and not overtaken.is_set():
            overtaken.set()
            raise DeviceOvertaken(generator.name, "STATUS was overtaken by off")
        return status()

    monkeypatch.setattr(generator, "status", overtaken_once)
    with lab.run(plan_of(2)) as run:
        assert run.outcome == RunOutcome.COMPLETED
    assert overtaken.is_set()


@pytest.mark.parametrize("generator_says", ["overtaken", "refused"])
def test_the_cause_is_the_door_and_never_what_the_generator_says_of_it(
    lab: Laboratory, monkeypatch: pytest.MonkeyPatch, generator_says: str
) -> None:
    """Light off comes before the reason: a shot that is being asked for fails first, and knows nothing."""
    generator, fire = lab.memory.generator, lab.memory.generator.fire

    def fire_behind_an_open_door() -> FiredTrain:
        lab.memory.open_door()
        if generator_says == "overtaken":
            raise DeviceOvertaken(generator.name, "FIRE was overtaken by off")
        return fire()

    monkeypatch.setattr(generator, "fire", fire_behind_an_open_door)
    reader = lab.run(plan_of())
    assert (reader.outcome, reader.cause) == ("failed", "door: the interlock is open")
    assert [cause.code for cause in reader.causes] == [CauseCode.INTERLOCK_OPEN]
    assert "overtaken" not in lab.messages()


def test_a_door_that_the_generator_sees_first_is_a_door_and_no_fault_of_the_generator(lab: Laboratory) -> None:
    reader = lab.start_and_await_shot(plan_of(**SLOW), 0)
    lab.memory.generator.set_interlock(False)
    lab.acquisition.wait(DEADLINE_S)
    assert reader.cause == "generator: the interlock input of the pulse generator is open"
    assert [cause.code for cause in reader.causes] == [CauseCode.INTERLOCK_OPEN]


def test_a_second_cause_of_its_own_is_kept_beside_the_first(lab: Laboratory) -> None:
    reader = lab.start_and_await_shot(plan_of(**SLOW), 0)
    lab.memory.generator.restarted = True
    lab.memory.open_door()
    lab.acquisition.wait(DEADLINE_S)
    assert {cause.code for cause in reader.causes} == {CauseCode.INTERLOCK_OPEN, CauseCode.GENERATOR_FAILED}
    assert reader.cause == reader.causes[0].text
    assert all(reader.header.created_utc < cause.at_utc <= reader.ended_utc for cause in reader.causes)


def test_each_of_two_causes_is_acknowledged_by_itself(lab: Laboratory) -> None:
    lab.start_and_await_shot(plan_of(**SLOW), 0)
    lab.memory.generator.restarted = True
    lab.memory.open_door()
    causes = lab.acquisition.wait(DEADLINE_S).to_acknowledge
    assert {cause.code for cause in causes} == {CauseCode.INTERLOCK_OPEN, CauseCode.GENERATOR_FAILED}
    assert f"a second cause, to be acknowledged by itself: {causes[1].text}" in lab.messages()
    with pytest.raises(InterlockOpen):
        lab.acquisition.acknowledge()
    lab.memory.close_door()
    for left in (causes, causes[1:]):
        assert lab.acquisition.status().to_acknowledge == left
        with pytest.raises(NotAcknowledged, match=left[-1].text):
            lab.acquisition.start(plan_of(1))
        with pytest.raises(NotAcknowledged):
            lab.acquisition.start_live(LivePlan(pulse=None))
        lab.acquisition.acknowledge()
        assert f"acknowledged: {left[0].text}" in lab.messages()
    assert lab.run(plan_of(1)).outcome == "completed"


@pytest.mark.parametrize(
    ("step", "outcome", "code"),
    [("stop", "stopped", CauseCode.STOPPED), ("abort", "aborted", CauseCode.ABORTED), ("", "completed", None)],
)
def test_what_an_operator_ended_says_so_in_its_file(
    lab: Laboratory, step: str, outcome: str, code: CauseCode | None
) -> None:
    reader = lab.start_and_await_shot(plan_of(**(SLOW if step else {"shots": 1})), 0)
    if step:
        getattr(lab.acquisition, step)()
    lab.acquisition.wait(DEADLINE_S)
    assert reader.outcome == outcome
    assert [cause.code for cause in reader.causes] == ([code] if code else [])


class Clumsy:
    """An observer that breaks down before or after a run."""

    def __init__(self, when: str) -> None:
        self._when = when

    def before_run(self, plan: RunPlan, run_dir: Path | None) -> None:
        if self._when == "before":
            raise ZeroDivisionError("no nozzle")

    def after_run(self, run_dir: Path) -> None:
        if self._when == "after":
            raise ZeroDivisionError("no nozzle")


@pytest.mark.parametrize("when", ["before", "after"])
def test_a_bug_in_the_scene_is_a_failed_run_and_not_a_dead_thread(lab: Laboratory, when: str) -> None:
    acquisition = Acquisition(lab.memory.rig, lab.data_dir, limits=LIMITS, observers=[Clumsy(when)])
    run_dir = lab.data_dir / acquisition.start(plan_of(2))
    status = acquisition.wait(DEADLINE_S)
    assert (status.state, status.outcome) == (RunState.IDLE, RunOutcome.FAILED)
    assert "ZeroDivisionError('no nozzle')" in status.message
    assert "off" in lab.memory.journal
    reader = RunReader(run_dir)
    shots = 2 if when == "after" else 0
    assert (reader.shot_count, reader.outcome, reader.cause) == (shots, "failed", status.message)


def test_what_the_disk_refuses_an_observer_is_told_in_words(lab: Laboratory) -> None:
    class Writer(Clumsy):
        def after_run(self, run_dir: Path) -> None:
            raise OSError(errno.ENOSPC, "raw text")

    acquisition = Acquisition(lab.memory.rig, lab.data_dir, limits=LIMITS, observers=[Writer("")])
    reader = RunReader(lab.data_dir / acquisition.start(plan_of(2)))
    acquisition.wait(DEADLINE_S)
    assert [cause.code for cause in reader.causes] == [CauseCode.DISK_FULL]
    assert f"the disk of {reader.run_dir} is full" in reader.cause


def test_observers_have_the_first_and_the_last_word(lab: Laboratory) -> None:
    lab.run(plan_of(2))
    assert lab.memory.journal[0] == "before sample"
    assert lab.memory.journal[-1] == "after, 2 shots, None"


def test_runs_without_an_outcome_are_closed_as_interrupted_and_told(
    lab: Laboratory, caplog: pytest.LogCaptureFixture
) -> None:
    done = lab.run(plan_of(1))
    header = done.header.model_copy(update={"run_id": "20260101T000000-killed"})
    with RunWriter(lab.data_dir / header.run_id, header):
        pass
    lab.events.clear()
    lab.acquisition.recover()
    reader = RunReader(lab.data_dir / header.run_id)
    assert (reader.outcome, reader.cause) == (RunOutcome.INTERRUPTED, INTERRUPTED_CAUSE)
    told = f"interrupted at {reader.ended_utc}: {INTERRUPTED_CAUSE}"
    assert lab.events == [RunMessage(header.run_id, told)]
    assert f"{header.run_id}: {told}" in caplog.text


@pytest.mark.parametrize(
    ("error", "cause"),
    [
        (None, "the program ended before the run did"),
        (KeyboardInterrupt("SIGTERM"), "the program was ended by SIGTERM"),
        (KeyboardInterrupt(), "the program was ended by SIGINT"),
        (ZeroDivisionError("no nozzle"), "the program ended before the run did: ZeroDivisionError('no nozzle')"),
    ],
)
def test_leaving_ends_the_run_in_the_dark_and_says_why(tmp_path: Path, error: BaseException | None, cause: str) -> None:
    lab = Laboratory(tmp_path)
    with suppress(KeyboardInterrupt, ZeroDivisionError), lab.acquisition:
        reader = lab.start_and_await_shot(plan_of(**SLOW), 0)
        if error:
            raise error
    assert (reader.outcome, reader.cause) == ("aborted", cause)
    assert lab.memory.generator.state is GeneratorState.SAFE
    with pytest.raises(BusyError, match=f"no run starts any more: {re.escape(cause)}"):
        lab.acquisition.start(plan_of())
