"""SimulatedLaboratory: what lies around the simulated devices; light reaches the cameras here, and faults happen."""

import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Self

from daq.faults import LABORATORY_FAULTS, Fault, FaultKind, ScriptedFault
from daq.shot import FiredTrain
from daq.simulation.camera.gige_camera import SimulatedCamera
from daq.simulation.interlock import DoorSwitch
from daq.simulation.pico.firmware_process import FirmwareProcess
from daq.simulation.stage import SimulatedStage

_CAMERA_FAULTS: Mapping[FaultKind, Callable[[float], Mapping[str, float | bool]]] = {
    FaultKind.PACKET_LOSS: lambda percent: {"packet_loss": percent / 100},
    FaultKind.MISSED_TRIGGER: lambda shots: {"missed_triggers": int(shots)},
    FaultKind.DROPPED_A: lambda shots: {"dropped_a": int(shots)},
    FaultKind.DROPPED_B: lambda shots: {"dropped_b": int(shots)},
    FaultKind.SWAPPED: lambda shots: {"swapped": int(shots)},
    FaultKind.WRONG_SIZE: lambda shots: {"wrong_size": int(shots)},
    FaultKind.LATE: lambda seconds: {"late_s": seconds, "late": 1},
    FaultKind.TIMESTAMP_JUMP: lambda seconds: {"timestamp_jump_ns": round(seconds * 1e9)},
    FaultKind.FROZEN: lambda _: {"frozen": True},
    FaultKind.CONTROL_TAKEN: lambda _: {"held_by_another": True},
}
"""Fields of ``CameraFaults`` that a fault sets, from its amount."""


@dataclass(frozen=True)
class SimulatedDevices:
    """The simulated devices: everything that a fault can happen to."""

    cameras: Mapping[str, SimulatedCamera]
    generator: FirmwareProcess
    switch: DoorSwitch
    stage: SimulatedStage


class SimulatedLaboratory:
    """What was fired triggers cameras, doors open, things go wrong. A context manager.

    Parameters
    ----------
    script : sequence of ScriptedFault
        Faults by the sequence number of the firing at which they happen.
    """

    def __init__(self, script: Sequence[ScriptedFault] = ()) -> None:
        self._script = tuple(script)
        self._connected: SimulatedDevices | None = None
        self._pulse_faults: list[Fault] = []
        self._fired: list[FiredTrain] = []
        self._firing = threading.Lock()
        # The generator calls from the thread that also reads its answers: what asks it needs another one.
        self._visitor = ThreadPoolExecutor(1, thread_name_prefix="laboratory visitor")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._visitor.shutdown()

    @property
    def devices(self) -> SimulatedDevices:
        """The simulated devices, once they are connected."""
        if self._connected is None:
            raise RuntimeError("the laboratory has no devices yet")
        return self._connected

    def connect(self, devices: SimulatedDevices) -> None:
        """Put the devices into the laboratory and close the door."""
        self._connected = devices
        self.close_door()

    def close_door(self) -> None:
        """Allow light."""
        self.devices.generator.set_interlock(True)
        self.devices.switch.close_door()

    def open_door(self) -> None:
        """Open the interlock; it reaches the pulse generator and the computer on wires of their own."""
        self.devices.generator.set_interlock(False)
        self.devices.switch.open_door()

    @property
    def fired(self) -> tuple[FiredTrain, ...]:
        """What was fired since ``forget_fired``."""
        with self._firing:
            return tuple(self._fired)

    def forget_fired(self) -> None:
        """Start a new record of what is fired."""
        with self._firing:
            self._fired = []

    def inject(self, fault: Fault) -> None:
        """Let something go wrong, from now on or at the next shot; see ``FaultKind``.

        Raises
        ------
        ValueError
            The fault happens to a view that the laboratory does not have.
        """
        if fault.view is not None and fault.view not in self.devices.cameras:
            raise ValueError(f"there is no view {fault.view}; the bench has {sorted(self.devices.cameras)}")
        if fault.kind in LABORATORY_FAULTS:
            self._spoil_laboratory(fault)
        elif fault.kind in (FaultKind.PULSE_B_LOST, FaultKind.PULSE_B_LATE):
            with self._firing:
                self._pulse_faults.append(fault)
        elif fault.kind is FaultKind.KILLED:
            self.devices.cameras[str(fault.view)].kill()
        else:
            for field, value in _CAMERA_FAULTS[fault.kind](fault.amount).items():
                setattr(self.devices.cameras[str(fault.view)].faults, field, value)

    def on_fired(self, train: FiredTrain) -> None:
        """Carry light and triggers to the cameras; called by the pulse generator for every shot."""
        for scripted in self._script:
            if scripted.sequence == train.sequence:
                self._happen(scripted)
        with self._firing:
            self._fired.append(train)
            spoiling, self._pulse_faults = self._pulse_faults, []
        for fault in spoiling:
            train = _spoiled(train, fault)
        for camera in self.devices.cameras.values():
            camera.trigger(train)

    def _happen(self, fault: Fault) -> None:
        if fault.kind in LABORATORY_FAULTS:
            self._visitor.submit(self._spoil_laboratory, fault)
        else:
            self.inject(fault)

    def _spoil_laboratory(self, fault: Fault) -> None:
        match fault.kind:
            case FaultKind.GENERATOR_RESET:
                self.devices.generator.reset()
            case FaultKind.SERIAL_GARBAGE:
                self.devices.generator.garbage(bytes(number % 256 for number in range(int(fault.amount))))
            case FaultKind.INTERLOCK_OPEN:
                self.open_door()
            case FaultKind.STAGE_STALL:
                self.devices.stage.stall()


def _spoiled(train: FiredTrain, fault: Fault) -> FiredTrain:
    """The same firing, with second pulses of one view that are missing or late."""
    view = str(fault.view)
    first, second = train.pulses.get(view, ())[:1], train.pulses.get(view, ())[1:]
    late_ns = round(fault.amount * 1000)
    late = tuple(replace(pulse, start_ns=pulse.start_ns + late_ns) for pulse in second)
    kept = () if fault.kind is FaultKind.PULSE_B_LOST else late
    return replace(train, pulses={**train.pulses, view: first + kept})
