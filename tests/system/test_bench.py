"""Runs on the simulated bench: plan to file, through real drivers and the firmware's own core."""

import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from daq.devices import GeneratorState
from daq.errors import DeviceRefused, InterlockOpen, PlanError
from daq.faults import Fault, FaultKind
from daq.files.run_directory import RunReader
from daq.run.acquisition import Acquisition
from daq.run.events import RunEvent, RunStatus, ShotRecorded
from daq.run.limits import AcquisitionLimits
from daq.run.state import RunOutcome, RunState
from daq.run_plan import ImageKey, PulsePair, RunKind, RunPlan
from processing.synthetic.truth_file import read_true_cameras, read_true_spray
from server.rig.assembly import AssembledRig, open_rig
from server.rig.config import load_config
from server.rig.simulated_operator import TRUTH_FILE

pytestmark = pytest.mark.network
SMALL, FULL = (Path("configs") / name for name in ("simulated_small.toml", "simulated.toml"))
LIMITS = AcquisitionLimits(frame_s=2.5)
PATIENT = AcquisitionLimits(frame_s=10.0)
CURRENT_A = {name: view.nominal_current_a for name, view in load_config(SMALL).views.items()}


@pytest.fixture(scope="module")
def assembled() -> Iterator[AssembledRig]:
    with open_rig(load_config(SMALL)) as opened:
        yield opened


def plan(kind: RunKind, shots: int, **changes: object) -> RunPlan:
    fields = {
        "name": kind.value,
        "kind": kind,
        "shots": shots,
        "rate_hz": 10.0,
        "pulse": PulsePair(current_a=CURRENT_A),
    }
    return RunPlan.model_validate(fields | changes)


def record(
    assembled: AssembledRig, data_dir: Path, of: RunPlan, limits: AcquisitionLimits = LIMITS
) -> tuple[RunStatus, RunReader]:
    with Acquisition(assembled.rig, data_dir, limits=limits, observers=assembled.observers) as acquisition:
        run_id = acquisition.start(of)
        status = acquisition.wait(60.0)
    return status, RunReader(data_dir / run_id)


def medians(reader: RunReader, index: int) -> dict[str, tuple[float, float]]:
    views = reader.read_shot(index).views.items()
    return {
        name: (float(np.median(v.frame_a)), float(np.median(v.frame_b))) for name, v in views if v.frame_b is not None
    }


def test_a_background_run_is_complete_and_lit(assembled: AssembledRig, tmp_path: Path) -> None:
    status, reader = record(assembled, tmp_path, plan(RunKind.BACKGROUND, 3))
    assert (status.state, status.outcome) == (RunState.IDLE, RunOutcome.COMPLETED)
    assert (status.shots_planned, status.shots_recorded, status.shots_valid) == (3, 3, 3)
    with reader:
        assert list(reader.image_keys()) == [ImageKey.BACKGROUND] * 3
        for index in range(3):
            assert reader.read_shot(index).valid
            assert all(90 < a < 170 and 90 < b < 170 for a, b in medians(reader, index).values())


def test_a_sample_run_knows_its_references_and_its_truth(assembled: AssembledRig, tmp_path: Path) -> None:
    dark, background = (
        record(assembled, tmp_path, plan(kind, 2))[1].header.run_id for kind in (RunKind.DARK, RunKind.BACKGROUND)
    )
    status, reader = record(assembled, tmp_path, plan(RunKind.SAMPLE, 2, references=(dark, background)))
    assert (status.outcome, status.shots_valid) == (RunOutcome.COMPLETED, 2)
    with reader:
        first, second = reader.read_shot(0), reader.read_shot(1)
        for view in CURRENT_A:
            lit, unlit = reader.background(view), reader.dark(view)
            assert lit is not None
            assert unlit is not None
            assert lit.mean() > 10 * unlit.mean()
            shadows = lit[0] - first.views[view].frame_a
            assert np.percentile(shadows, 99.5) > 40
            assert np.any(first.views[view].frame_a != second.views[view].frame_a)
    truth = tmp_path / reader.header.run_id / TRUTH_FILE
    assert set(read_true_cameras(truth)) == set(CURRENT_A)
    for shot in (first, second):
        assert shot.fired is not None
        assert len(read_true_spray(truth, shot.fired.sequence).spray) > 1000


def test_a_current_above_the_limit_of_its_led_is_refused(assembled: AssembledRig, tmp_path: Path) -> None:
    too_high = PulsePair(current_a=CURRENT_A | {"view2": 12.5})
    with Acquisition(assembled.rig, tmp_path) as acquisition:
        with pytest.raises(PlanError, match=r"pulse\.current_a: 12\.5 A is above 12 A, the limit of the LED of view2"):
            acquisition.start(plan(RunKind.BACKGROUND, 1, pulse=too_high))
        assert acquisition.status().run_id is None


def test_a_dark_run_is_dark(assembled: AssembledRig, tmp_path: Path) -> None:
    status, reader = record(assembled, tmp_path, plan(RunKind.DARK, 1))
    assert status.shots_valid == 1
    with reader:
        assert all(max(levels) < 20 for levels in medians(reader, 0).values())


def test_a_calibration_run_moves_the_target(assembled: AssembledRig, tmp_path: Path) -> None:
    status, reader = record(assembled, tmp_path, plan(RunKind.CALIBRATION, 1, stage_z_mm=(-3.0, 0.0, 3.0)))
    assert (status.outcome, status.shots_valid) == (RunOutcome.COMPLETED, 3)
    with reader:
        shots = [reader.read_shot(index) for index in range(3)]
    for shot, z_mm in zip(shots, (-3.0, 0.0, 3.0), strict=True):
        assert shot.stage_z_mm == pytest.approx(z_mm, abs=0.0025)
    assert np.any(shots[0].views["view1"].frame_a != shots[1].views["view1"].frame_a)


def test_a_lost_exposure_is_fired_again(assembled: AssembledRig, tmp_path: Path) -> None:
    assert assembled.laboratory is not None
    assembled.laboratory.inject(Fault(kind=FaultKind.DROPPED_B, view="view3"))
    before = assembled.rig.generator.status().counters["fired"]
    status, reader = record(assembled, tmp_path, plan(RunKind.BACKGROUND, 2))
    assert (status.outcome, status.shots_recorded, status.shots_valid) == (RunOutcome.COMPLETED, 2, 2)
    with reader:
        sequences = [shot.fired.sequence for shot in map(reader.read_shot, range(2)) if shot.fired]
    assert assembled.rig.generator.status().counters["fired"] == before + 3
    assert sequences[1] == sequences[0] + 1


def test_without_quota_a_lost_exposure_keeps_its_slot(assembled: AssembledRig, tmp_path: Path) -> None:
    assert assembled.laboratory is not None
    assembled.laboratory.inject(Fault(kind=FaultKind.DROPPED_B, view="view3"))
    status, reader = record(assembled, tmp_path, plan(RunKind.BACKGROUND, 2, refire_quota=0))
    assert (status.shots_recorded, status.shots_valid) == (2, 1)
    with reader:
        assert list(reader.image_keys()) == [ImageKey.INVALID, ImageKey.BACKGROUND]
        assert not reader.read_shot(0).views["view3"].record_b.valid


def test_light_that_did_not_come_is_no_lost_frame(assembled: AssembledRig, tmp_path: Path) -> None:
    assert assembled.laboratory is not None
    assembled.laboratory.inject(Fault(kind=FaultKind.PULSE_B_LOST, view="view1"))
    status, reader = record(assembled, tmp_path, plan(RunKind.BACKGROUND, 2))
    assert (status.shots_recorded, status.shots_valid) == (2, 1)
    with reader:
        assert list(reader.image_keys()) == [ImageKey.INVALID, ImageKey.BACKGROUND]


def fail_in_mid_run(assembled: AssembledRig, data_dir: Path, mishap: Callable[[], None]) -> RunStatus:
    """Start a long run and let something happen after its first shot."""
    recorded = threading.Event()

    def watch(event: RunEvent) -> None:
        if isinstance(event, ShotRecorded):
            recorded.set()

    with Acquisition(assembled.rig, data_dir, watch, limits=LIMITS, observers=assembled.observers) as acquisition:
        run_id = acquisition.start(plan(RunKind.BACKGROUND, 1000))
        assert recorded.wait(20.0)
        mishap()
        status = acquisition.wait(20.0)
    with RunReader(data_dir / run_id) as reader:
        assert reader.outcome == status.outcome
        assert 1 <= reader.shot_count < 1000
    assert assembled.rig.generator.status().state is not GeneratorState.ARMED
    return status


def test_a_door_that_opens_in_a_run_ends_it_with_the_light_off(assembled: AssembledRig, tmp_path: Path) -> None:
    laboratory = assembled.laboratory
    assert laboratory is not None
    try:
        status = fail_in_mid_run(assembled, tmp_path, laboratory.open_door)
        assert (status.state, status.outcome) == (RunState.IDLE, RunOutcome.FAILED)
        assert "interlock" in status.message
        with Acquisition(assembled.rig, tmp_path) as acquisition, pytest.raises(InterlockOpen):
            acquisition.start(plan(RunKind.BACKGROUND, 1))
    finally:
        laboratory.close_door()
    with Acquisition(assembled.rig, tmp_path) as acquisition:
        acquisition.acknowledge()
    assert record(assembled, tmp_path, plan(RunKind.BACKGROUND, 1))[0].outcome is RunOutcome.COMPLETED


def test_a_generator_that_restarts_in_a_run_ends_it(assembled: AssembledRig, tmp_path: Path) -> None:
    laboratory = assembled.laboratory
    assert laboratory is not None
    status = fail_in_mid_run(assembled, tmp_path, lambda: laboratory.inject(Fault(kind=FaultKind.GENERATOR_RESET)))
    assert status.outcome is RunOutcome.FAILED
    assert "pulse_generator: the microcontroller was reset" in status.message
    with Acquisition(assembled.rig, tmp_path) as acquisition:
        with pytest.raises(DeviceRefused, match="fault: restarted; acknowledge it first"):
            acquisition.start(plan(RunKind.BACKGROUND, 1))
        acquisition.acknowledge()
    assert record(assembled, tmp_path, plan(RunKind.BACKGROUND, 1))[0].outcome is RunOutcome.COMPLETED


def test_noise_on_the_serial_line_does_not_end_a_run(assembled: AssembledRig, tmp_path: Path) -> None:
    assert assembled.laboratory is not None
    assembled.laboratory.inject(Fault(kind=FaultKind.SERIAL_GARBAGE, amount=300))
    assert record(assembled, tmp_path, plan(RunKind.BACKGROUND, 1))[0].outcome is RunOutcome.COMPLETED


def test_the_rig_of_the_paper_at_full_size(tmp_path: Path) -> None:
    with open_rig(load_config(FULL)) as assembled:
        status, reader = record(assembled, tmp_path, plan(RunKind.SAMPLE, 1, rate_hz=1.0), PATIENT)
        assert (status.outcome, status.shots_valid) == (RunOutcome.COMPLETED, 1)
        with reader:
            frames = reader.read_shot(0).views
    assert {view: frames[view].frame_a.shape for view in frames} == dict.fromkeys(CURRENT_A, (1200, 1600))
