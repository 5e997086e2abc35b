"""What each kind of fault does to the simulated devices, and how one that lasts is mended."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from daq.faults import Fault, FaultKind
from daq.simulation.camera.gige_camera import SimulatedCamera
from daq.simulation.interlock import DoorSwitch
from daq.simulation.pico.firmware_process import FirmwareProcess
from daq.simulation.stage import SimulatedStage


@dataclass(frozen=True)
class SimulatedDevices:
    """The simulated devices: everything that a fault can happen to."""

    cameras: Mapping[str, SimulatedCamera]
    generator: FirmwareProcess
    switch: DoorSwitch
    stage: SimulatedStage

    def camera_of(self, fault: Fault) -> SimulatedCamera:
        """The camera that a fault happens to."""
        return self.cameras[str(fault.view)]

    def close_door(self) -> None:
        """Allow light."""
        self.generator.set_interlock(True)
        self.switch.close_door()

    def open_door(self) -> None:
        """Open the interlock; it reaches the pulse generator and the computer on wires of their own."""
        self.generator.set_interlock(False)
        self.switch.open_door()


Act = Callable[[SimulatedDevices, Fault], None]


def _spoil(spoiled: Callable[[float], Mapping[str, float | bool]]) -> Act:
    """Set fields of ``CameraFaults``, from the amount of the fault."""

    def act(devices: SimulatedDevices, fault: Fault) -> None:
        for field, value in spoiled(fault.amount).items():
            setattr(devices.camera_of(fault).faults, field, value)

    return act


def _jump(direction: int) -> Act:
    """Let the clock of the camera jump, from where it is."""

    def act(devices: SimulatedDevices, fault: Fault) -> None:
        devices.camera_of(fault).faults.timestamp_jump_ns += direction * round(fault.amount * 1e9)

    return act


BEGINNINGS: Mapping[FaultKind, Act] = {
    FaultKind.PACKET_LOSS: _spoil(lambda percent: {"packet_loss": percent / 100}),
    FaultKind.PACKETS_DOUBLED: _spoil(lambda percent: {"packets_doubled": percent / 100}),
    FaultKind.PACKETS_SWAPPED: _spoil(lambda percent: {"packets_swapped": percent / 100}),
    FaultKind.LEADER_LOST: _spoil(lambda images: {"leaders_lost": int(images)}),
    FaultKind.TRAILER_LOST: _spoil(lambda images: {"trailers_lost": int(images)}),
    FaultKind.BLOCK_DOUBLED: _spoil(lambda shots: {"doubled": int(shots)}),
    FaultKind.IDS_WRAP: _spoil(lambda blocks: {"blocks_before_wrap": int(blocks)}),
    FaultKind.MISSED_TRIGGER: _spoil(lambda shots: {"missed_triggers": int(shots)}),
    FaultKind.DROPPED_A: _spoil(lambda shots: {"dropped_a": int(shots)}),
    FaultKind.DROPPED_B: _spoil(lambda shots: {"dropped_b": int(shots)}),
    FaultKind.SWAPPED: _spoil(lambda shots: {"swapped": int(shots)}),
    FaultKind.WRONG_SIZE: _spoil(lambda shots: {"wrong_size": int(shots)}),
    FaultKind.LATE: _spoil(lambda seconds: {"late_s": seconds, "late": 1}),
    FaultKind.TIMESTAMP_JUMP: _jump(+1),
    FaultKind.CLOCK_BACK: _jump(-1),
    FaultKind.FROZEN: _spoil(lambda _: {"frozen": True}),
    FaultKind.KILLED: lambda devices, fault: devices.camera_of(fault).kill(),
    FaultKind.CONTROL_TAKEN: _spoil(lambda _: {"held_by_another": True}),
    FaultKind.GENERATOR_RESET: lambda devices, _: devices.generator.reset(),
    FaultKind.GENERATOR_WATCHDOG: lambda devices, _: devices.generator.reset(by_watchdog=True),
    FaultKind.SET_POINT: lambda devices, _: devices.generator.set_converter(False),
    FaultKind.GENERATOR_HANG: lambda devices, _: devices.generator.hang(),
    FaultKind.GENERATOR_UNPLUGGED: lambda devices, _: devices.generator.unplug(),
    FaultKind.REPLIES_LOST: lambda devices, fault: devices.generator.lose_replies(int(fault.amount)),
    FaultKind.REPLIES_DAMAGED: lambda devices, fault: devices.generator.damage_replies(int(fault.amount)),
    FaultKind.SERIAL_GARBAGE: lambda devices, fault: devices.generator.garbage(
        bytes(number % 256 for number in range(int(fault.amount)))
    ),
    FaultKind.INTERLOCK_OPEN: lambda devices, _: devices.open_door(),
    FaultKind.ESTOP_PRESSED: lambda devices, _: devices.generator.set_estop(False),
    FaultKind.STAGE_STALL: lambda devices, _: devices.stage.stall(),
    FaultKind.STAGE_UNPLUGGED: lambda devices, _: devices.stage.unplug(),
}
"""How a fault begins. Those of light pulses are made in ``SimulatedLaboratory``; POWER_CYCLED is KILLED with an end."""

ENDINGS: Mapping[FaultKind, Act] = {
    FaultKind.PACKET_LOSS: _spoil(lambda _: {"packet_loss": 0.0}),
    FaultKind.PACKETS_DOUBLED: _spoil(lambda _: {"packets_doubled": 0.0}),
    FaultKind.PACKETS_SWAPPED: _spoil(lambda _: {"packets_swapped": 0.0}),
    FaultKind.IDS_WRAP: _spoil(lambda _: {"blocks_before_wrap": 0}),
    FaultKind.FROZEN: _spoil(lambda _: {"frozen": False}),
    FaultKind.KILLED: lambda devices, fault: devices.camera_of(fault).power_on(),
    FaultKind.CONTROL_TAKEN: _spoil(lambda _: {"held_by_another": False}),
    FaultKind.SET_POINT: lambda devices, _: devices.generator.set_converter(True),
    FaultKind.GENERATOR_HANG: lambda devices, _: devices.generator.go_on(),
    FaultKind.GENERATOR_UNPLUGGED: lambda devices, _: devices.generator.plug_in(),
    FaultKind.INTERLOCK_OPEN: lambda devices, _: devices.close_door(),
    FaultKind.ESTOP_PRESSED: lambda devices, _: devices.generator.set_estop(True),
    FaultKind.STAGE_STALL: lambda devices, _: devices.stage.stall(False),
    FaultKind.STAGE_UNPLUGGED: lambda devices, _: devices.stage.plug_in(),
}
"""How a fault that lasts ends."""
