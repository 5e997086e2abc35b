"""Runs with the real driver and the real firmware core; only the cameras are in memory."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from daq.devices import Rig
from daq.drivers.serial_pulse_generator import SerialPulseGenerator
from daq.errors import DeviceError, DeviceRefused
from daq.files.run_directory import RunReader
from daq.run.acquisition import Acquisition
from daq.run.limits import AcquisitionLimits
from daq.run.state import RunOutcome, RunState
from daq.run_plan import PulsePair, RunKind, RunPlan
from daq.shot import FiredTrain
from daq.simulation.interlock import MemoryInterlock
from daq.simulation.pico.firmware_process import FirmwareProcess
from tests.support.memory_devices import MemoryCamera
from tests.support.memory_rig import FORMATS, TIMING, flat_field

CHANNELS = {"view1": 0, "view2": 3}
LIMITS = AcquisitionLimits(frame_s=0.5, light_off_s=0.5, disarm_s=0.5, drain_s=10)
DEADLINE_S = 30.0


class FirmwareLaboratory:
    """A rig around the firmware, and its acquisition."""

    def __init__(self, data_dir: Path) -> None:
        self.cameras = {view: MemoryCamera(view, [], flat_field, FORMATS["view1"], TIMING) for view in CHANNELS}
        self.firmware = FirmwareProcess(CHANNELS, self._fired)
        self.door = MemoryInterlock("door")
        self.door.close_door()
        self.data_dir = data_dir

    def _fired(self, train: FiredTrain) -> None:
        for camera in self.cameras.values():
            camera.trigger(train)

    def acquisition(self, generator: SerialPulseGenerator) -> Acquisition:
        return Acquisition(Rig(self.cameras, generator, self.door), self.data_dir, limits=LIMITS)


@pytest.fixture
def laboratory(tmp_path: Path) -> Iterator[FirmwareLaboratory]:
    laboratory = FirmwareLaboratory(tmp_path)
    with laboratory.firmware:
        yield laboratory


@pytest.fixture
def acquisition(laboratory: FirmwareLaboratory) -> Iterator[Acquisition]:
    with (
        SerialPulseGenerator("generator", laboratory.firmware.port, CHANNELS) as generator,
        laboratory.acquisition(generator) as acquisition,
    ):
        yield acquisition


def plan_of(shots: int, rate_hz: float, **changes: object) -> RunPlan:
    pulse = PulsePair(current_a={"view1": 26.0, "view2": 10.0})
    return RunPlan.model_validate({"name": "firmware", "shots": shots, "rate_hz": rate_hz, "pulse": pulse, **changes})


def await_true(condition: Callable[[], bool]) -> None:
    deadline, tick = time.monotonic() + DEADLINE_S, threading.Event()
    while not condition():
        assert time.monotonic() < deadline
        tick.wait(0.005)


def test_the_firmware_fires_every_shot_as_asked(laboratory: FirmwareLaboratory, acquisition: Acquisition) -> None:
    reader = RunReader(laboratory.data_dir / acquisition.start(plan_of(20, 10)))
    status = acquisition.wait(DEADLINE_S)
    assert (status.outcome, status.shots_valid) == (RunOutcome.COMPLETED, 20)
    trains = [reader.read_shot(index).fired for index in range(20)]
    sequences = [train.sequence for train in trains if train]
    assert sequences == list(range(sequences[0], sequences[0] + 20))
    assert trains[-1] is not None
    pulses = trains[-1].pulses["view1"]
    assert (pulses[1].start_ns - pulses[0].start_ns, pulses[0].width_ns, pulses[0].current_a) == (6400, 1000, 26.0)
    assert reader.header.devices["generator"]["vendor"] == "tomoshadow"


def test_a_dark_run_fires_cameras_without_light(laboratory: FirmwareLaboratory, acquisition: Acquisition) -> None:
    reader = RunReader(laboratory.data_dir / acquisition.start(plan_of(3, 50, kind=RunKind.DARK)))
    assert acquisition.wait(DEADLINE_S).shots_valid == 3
    fired = reader.read_shot(0).fired
    assert fired is not None
    assert not any(fired.pulses.values())


def test_the_heartbeat_keeps_a_slow_run_armed(acquisition: Acquisition) -> None:
    acquisition.start(plan_of(2, 0.4))
    status = acquisition.wait(DEADLINE_S)
    assert (status.outcome, status.shots_valid) == (RunOutcome.COMPLETED, 2)


def test_an_interlock_trip_of_the_firmware_is_named_and_acknowledged(
    laboratory: FirmwareLaboratory, acquisition: Acquisition
) -> None:
    acquisition.start(plan_of(100, 0.2))
    await_true(lambda: acquisition.status().shots_recorded == 1)
    laboratory.firmware.set_interlock(False)
    status = acquisition.wait(DEADLINE_S)
    assert (status.state, status.outcome) == (RunState.IDLE, RunOutcome.FAILED)
    assert "interlock" in status.message
    laboratory.firmware.set_interlock(True)
    with pytest.raises(DeviceRefused, match="interlock; acknowledge it first"):
        acquisition.start(plan_of(1, 10))
    acquisition.acknowledge()
    acquisition.start(plan_of(1, 10))
    assert acquisition.wait(DEADLINE_S).outcome is RunOutcome.COMPLETED


def test_a_generator_that_dies_leaves_a_fault(laboratory: FirmwareLaboratory) -> None:
    """Its light is off, but nobody can know: the operator must look."""
    with suppress(DeviceError), SerialPulseGenerator("generator", laboratory.firmware.port, CHANNELS) as generator:
        acquisition = laboratory.acquisition(generator)
        run_id = acquisition.start(plan_of(100, 20))
        await_true(lambda: acquisition.status().shots_recorded >= 2)
        laboratory.firmware.kill()
        status = acquisition.wait(DEADLINE_S)
        assert (status.state, status.outcome) == (RunState.FAULT, RunOutcome.FAILED)
        reader = RunReader(laboratory.data_dir / run_id)
        assert reader.outcome == "failed"
        assert reader.shot_count == status.shots_recorded
        with pytest.raises(DeviceError, match="generator"):
            acquisition.acknowledge()
        assert acquisition.status().state is RunState.FAULT
