"""SimulatedLaboratory: what lies around the simulated devices; light reaches the cameras here, and faults happen."""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from types import TracebackType
from typing import Self

from daq.faults import LABORATORY_FAULTS, Fault, FaultKind, ScriptedFault
from daq.shot import FiredTrain
from daq.simulation.fault_ends import FaultEnds
from daq.simulation.mishaps import BEGINNINGS, ENDINGS, SimulatedDevices

_PULSE_FAULTS = frozenset({FaultKind.PULSE_B_LOST, FaultKind.PULSE_B_LATE})


class SimulatedLaboratory:
    """What was fired triggers cameras, doors open, things go wrong. A context manager.

    Parameters
    ----------
    script : sequence of ScriptedFault
        Faults by the sequence number of the firing at which they happen.

    Attributes
    ----------
    witnesses : list of Callable[[FiredTrain], None]
        Each is told of every firing, in the thread that reads the generator, and must not block.
    """

    def __init__(self, script: Sequence[ScriptedFault] = ()) -> None:
        self._script = tuple(script)
        self.witnesses: list[Callable[[FiredTrain], None]] = []
        self._connected: SimulatedDevices | None = None
        self._pulse_faults: list[Fault] = []
        self._firing = threading.Lock()
        self._ends = FaultEnds()
        # The generator calls from the thread that also reads its answers: what asks it needs another one.
        self._visitor = ThreadPoolExecutor(1, thread_name_prefix="laboratory visitor")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.disconnect()

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

    def disconnect(self) -> None:
        """Nothing happens to the devices any more; before they are closed."""
        self._ends.close()
        self._visitor.shutdown()

    is_apart = False
    """Its far ends run in this process, and end with it."""

    def ask(self) -> str:
        """Who runs the far ends."""
        return "this process"

    def close_door(self) -> None:
        """Allow light."""
        self.devices.close_door()

    def open_door(self) -> None:
        """Open the interlock."""
        self.devices.open_door()

    def inject(self, fault: Fault) -> None:
        """Let something go wrong, from now on or at the next shot, or mend it; see ``FaultKind``.

        Raises
        ------
        ValueError
            The fault happens to a view that the laboratory does not have.
        """
        if fault.view is not None and fault.view not in self.devices.cameras:
            raise ValueError(f"there is no view {fault.view}; the bench has {sorted(self.devices.cameras)}")
        if fault.kind in _PULSE_FAULTS:
            with self._firing:
                self._pulse_faults.append(fault)
        else:
            self._begin(fault)

    def _begin(self, fault: Fault) -> None:
        """Begin a fault and see to its end; of the same fault, what was said last holds."""
        cycled = fault.kind is FaultKind.POWER_CYCLED
        kind, duration_s = (FaultKind.KILLED, fault.amount) if cycled else (fault.kind, fault.duration_s)
        self._ends.cancel((kind, fault.view))
        if fault.duration_s == 0:
            ENDINGS[kind](self.devices, fault)
            return
        BEGINNINGS[kind](self.devices, fault)
        if duration_s is not None:
            self._ends.put((kind, fault.view), duration_s, partial(self._end, kind, fault))

    def _end(self, kind: FaultKind, fault: Fault) -> None:
        self._visitor.submit(ENDINGS[kind], self.devices, fault)

    def on_fired(self, train: FiredTrain) -> None:
        """Carry light and triggers to the cameras; called by the pulse generator for every shot."""
        for scripted in self._script:
            if scripted.sequence == train.sequence:
                self._happen(scripted)
        with self._firing:
            spoiling, self._pulse_faults = self._pulse_faults, []
        for witness in self.witnesses:
            witness(train)
        for fault in spoiling:
            train = _spoiled(train, fault)
        for camera in self.devices.cameras.values():
            camera.trigger(train)

    def _happen(self, fault: Fault) -> None:
        if fault.kind in LABORATORY_FAULTS:
            self._visitor.submit(self.inject, fault)
        else:
            self.inject(fault)


def _spoiled(train: FiredTrain, fault: Fault) -> FiredTrain:
    """The same firing, with second pulses of one view that are missing or late."""
    view = str(fault.view)
    first, second = train.pulses.get(view, ())[:1], train.pulses.get(view, ())[1:]
    late_ns = round(fault.amount * 1000)
    late = tuple(replace(pulse, start_ns=pulse.start_ns + late_ns) for pulse in second)
    kept = () if fault.kind is FaultKind.PULSE_B_LOST else late
    return replace(train, pulses={**train.pulses, view: first + kept})
