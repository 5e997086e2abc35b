"""Every fault that lasts has an end: by its duration, in the script, or because somebody mends it."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from daq.drivers.aravis_camera import AravisCamera
from daq.drivers.camera_profile import load_camera_profile
from daq.drivers.gige_question import controller_of
from daq.drivers.serial_pulse_generator import SerialPulseGenerator
from daq.errors import DeviceError, DeviceUnavailable
from daq.faults import LABORATORY_FAULTS, LASTING_FAULTS, Fault, FaultKind, ScriptedFault
from daq.network import Network
from daq.shot import FiredTrain
from daq.simulation.camera.gige_camera import SimulatedCamera
from daq.simulation.interlock import MemoryInterlock
from daq.simulation.laboratory import SimulatedLaboratory
from daq.simulation.mishaps import BEGINNINGS, ENDINGS, SimulatedDevices
from daq.simulation.pico.firmware_process import FirmwareProcess
from daq.simulation.stage import SimulatedStage

pytestmark = pytest.mark.network

VIEW, IP, SHAPE = "view", "127.0.0.38", (24, 32)
PROFILE = load_camera_profile(Path(__file__).parents[3] / "configs" / "cameras" / "simulated.toml")
LIMIT_S = 10.0
SCRIPTED = ScriptedFault(kind=FaultKind.KILLED, view=VIEW, sequence=7, duration_s=0.2)
SCRIPTED_DOOR = ScriptedFault(kind=FaultKind.INTERLOCK_OPEN, sequence=8, duration_s=0.2)


@pytest.fixture
def laboratory() -> Iterator[SimulatedLaboratory]:
    camera = SimulatedCamera(
        VIEW, IP, "SN38", PROFILE.camera_timing, lambda seen: np.zeros(seen.shape, np.uint8), SHAPE
    )
    with (
        SimulatedLaboratory((SCRIPTED, SCRIPTED_DOOR)) as laboratory,
        FirmwareProcess({VIEW: 0}, laboratory.on_fired) as generator,
        camera,
        SimulatedStage() as stage,
    ):
        laboratory.connect(SimulatedDevices({VIEW: camera}, generator, MemoryInterlock("door"), stage))
        yield laboratory
        laboratory.disconnect()


def fault(kind: FaultKind, duration_s: float | None = None, amount: float = 1.0) -> Fault:
    view = None if kind in LABORATORY_FAULTS else VIEW
    return Fault(kind=kind, view=view, duration_s=duration_s, amount=amount)


def answers(_: SimulatedLaboratory) -> bool:
    try:
        controller_of(VIEW, IP, 0.3)
    except DeviceUnavailable:
        return False
    return True


def port_is_there(laboratory: SimulatedLaboratory) -> bool:
    return Path(laboratory.devices.generator.port).exists()


def generator_answers(laboratory: SimulatedLaboratory) -> bool:
    try:
        with SerialPulseGenerator("generator", laboratory.devices.generator.port, {VIEW: 0}) as generator:
            return generator.status().interlock_closed and generator.status().estop_closed
    except DeviceError:
        return False


def generator_can_be_cleared(laboratory: SimulatedLaboratory) -> bool:
    try:
        with SerialPulseGenerator("generator", laboratory.devices.generator.port, {VIEW: 0}) as generator:
            generator.clear()
    except DeviceError:
        return False
    return True


WELL: dict[FaultKind, Callable[[SimulatedLaboratory], bool]] = {
    FaultKind.PACKET_LOSS: lambda bench: bench.devices.cameras[VIEW].faults.packet_loss == 0,
    FaultKind.PACKETS_DOUBLED: lambda bench: bench.devices.cameras[VIEW].faults.packets_doubled == 0,
    FaultKind.PACKETS_SWAPPED: lambda bench: bench.devices.cameras[VIEW].faults.packets_swapped == 0,
    FaultKind.IDS_WRAP: lambda bench: bench.devices.cameras[VIEW].faults.blocks_before_wrap == 0,
    FaultKind.FROZEN: answers,
    FaultKind.KILLED: answers,
    FaultKind.CONTROL_TAKEN: lambda bench: not bench.devices.cameras[VIEW].faults.held_by_another,
    FaultKind.SET_POINT: generator_can_be_cleared,
    FaultKind.GENERATOR_HANG: generator_answers,
    FaultKind.GENERATOR_UNPLUGGED: port_is_there,
    FaultKind.INTERLOCK_OPEN: generator_answers,
    FaultKind.ESTOP_PRESSED: generator_answers,
    FaultKind.STAGE_STALL: lambda bench: not bench.devices.stage.is_stalled,
    FaultKind.STAGE_UNPLUGGED: lambda bench: Path(bench.devices.stage.port).exists(),
}


def becomes_well(laboratory: SimulatedLaboratory, kind: FaultKind) -> bool:
    deadline_s = time.monotonic() + LIMIT_S
    while not WELL[kind](laboratory):
        if time.monotonic() > deadline_s:
            return False
        time.sleep(0.02)
    return True


def test_every_kind_begins_and_every_lasting_one_ends() -> None:
    made_of_light = {FaultKind.PULSE_B_LOST, FaultKind.PULSE_B_LATE}
    assert set(BEGINNINGS) == set(FaultKind) - made_of_light - {FaultKind.POWER_CYCLED}
    assert set(ENDINGS) == LASTING_FAULTS == set(WELL)


@pytest.mark.parametrize("kind", sorted(LASTING_FAULTS))
def test_a_fault_that_lasts_ends_when_its_duration_is_over(laboratory: SimulatedLaboratory, kind: FaultKind) -> None:
    laboratory.inject(fault(kind))
    assert not WELL[kind](laboratory)
    laboratory.inject(fault(kind, duration_s=0.1))
    assert becomes_well(laboratory, kind)


@pytest.mark.parametrize("kind", [FaultKind.KILLED, FaultKind.GENERATOR_UNPLUGGED, FaultKind.STAGE_UNPLUGGED])
def test_no_duration_left_ends_it_at_once(laboratory: SimulatedLaboratory, kind: FaultKind) -> None:
    laboratory.inject(fault(kind, duration_s=60.0))
    assert not WELL[kind](laboratory)
    for _ in range(2):
        laboratory.inject(fault(kind, duration_s=0))
        assert WELL[kind](laboratory)


def test_what_was_said_last_of_a_fault_holds(laboratory: SimulatedLaboratory) -> None:
    laboratory.inject(fault(FaultKind.FROZEN, duration_s=0.05))
    laboratory.inject(fault(FaultKind.FROZEN))
    time.sleep(0.2)
    assert laboratory.devices.cameras[VIEW].faults.frozen


@pytest.mark.parametrize("kind", sorted(set(FaultKind) - LASTING_FAULTS))
def test_a_fault_that_ends_by_itself_takes_no_duration(kind: FaultKind) -> None:
    for view in (VIEW, None):
        with pytest.raises(ValidationError):
            Fault(kind=kind, view=view, duration_s=1.0)


@pytest.mark.parametrize(
    "wrong",
    [
        {"kind": "interlock_open", "duration_s": 1e300},
        {"kind": "serial_garbage", "amount": 1e9},
        {"kind": "serial_garbage", "amount": float("nan")},
        {"kind": "packet_loss", "view": VIEW, "amount": 200},
    ],
    ids=str,
)
def test_a_fault_beyond_all_measure_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match=r"less than or equal to 100000|200 % is more than all"):
        Fault.model_validate(wrong)


def test_a_camera_with_power_again_has_factory_settings_and_another_clock(laboratory: SimulatedLaboratory) -> None:
    with AravisCamera(VIEW, IP, PROFILE, SHAPE, Network(packet_bytes=9000)) as camera:
        camera.arm()
        time.sleep(0.5)
        before_ns = camera._connected().clock_ns()
        laboratory.inject(Fault(kind=FaultKind.POWER_CYCLED, view=VIEW, amount=0.1))
        assert becomes_well(laboratory, FaultKind.KILLED)
        bank = laboratory.devices.cameras[VIEW]._bank
        assert (bank.frames_per_trigger, bank[0x8020], bank[0x0D04]) == (1, 0, 1500)
        assert not controller_of(VIEW, IP)
        camera.disarm()
        camera.arm()
        assert camera._connected().clock_ns() < before_ns
        assert (bank.frames_per_trigger, bank[0x8020], bank[0x0D04] & 0xFFFF) == (2, 1, 9000)


def test_scripted_faults_end_too(laboratory: SimulatedLaboratory) -> None:
    laboratory.on_fired(FiredTrain(7, {}))
    assert not answers(laboratory)
    assert becomes_well(laboratory, FaultKind.KILLED)
    laboratory.on_fired(FiredTrain(8, {}))
    door = laboratory.devices.switch
    assert isinstance(door, MemoryInterlock)
    assert door.wait_for_change(LIMIT_S)
    assert becomes_well(laboratory, FaultKind.INTERLOCK_OPEN)
    assert door.is_closed()


def test_nothing_ends_after_the_laboratory_is_closed(laboratory: SimulatedLaboratory) -> None:
    laboratory.inject(fault(FaultKind.KILLED, duration_s=0.1))
    laboratory.disconnect()
    time.sleep(0.3)
    assert not answers(laboratory)
