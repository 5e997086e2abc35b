"""The seam: what acquisition asks of a device. Drivers and simulations are tested by one contract suite each.

A constructor acquires nothing; ``with device:`` opens and closes it. Light is off after opening, after
an error and after closing. Every method has a deadline and raises ``daq.errors.DeviceTimeout``.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from types import TracebackType
from typing import Protocol, Self

from daq.network import Network
from daq.shot import DoubleFrame, FiredTrain
from daq.timing import CameraTiming, ShotTiming


@dataclass(frozen=True)
class DeviceIdentity:
    """Who a device says it is."""

    vendor: str
    model: str
    serial: str
    firmware: str


class Device(Protocol):
    """What every device has: a name in the rig, an identity, and a life between ``with`` and its end."""

    @property
    def name(self) -> str:
        """Name in the rig configuration."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def identity(self) -> DeviceIdentity:
        """Vendor, model, serial number and firmware version, as the device answers."""


class Camera(Device, Protocol):
    """A double-frame camera of one view."""

    @property
    def timing(self) -> CameraTiming:
        """Timing model of the armed profile."""

    @property
    def image_shape(self) -> tuple[int, int]:
        """(rows, columns) of one exposure."""

    @property
    def bits(self) -> int:
        """Significant bits of a grey value: 8 to 16."""

    @property
    def is_lost(self) -> bool:
        """The camera no longer answers, as far as is known; asking costs nothing and may come from any thread."""

    @property
    def has_half(self) -> bool:
        """One exposure of the firing has come, the other one has not; costs nothing and may come from any thread."""

    def ask(self) -> None:
        """A sign of life within a second, from any thread and also in a run; DeviceError if there is none."""

    def recover(self) -> None:
        """Open the camera anew if it was lost; for between runs. DeviceError if that is not possible yet."""

    def arm(self) -> None:
        """Write the profile, read every value back, drain the stream, start acquisition."""

    def begin_shot(self) -> None:
        """Re-base frame counting: whatever arrives from now on belongs to the next firing."""

    def collect(self, deadline_s: float) -> DoubleFrame:
        """Exposures A and B of the firing since ``begin_shot``; a missing one is flagged, not raised."""

    def disarm(self) -> None:
        """Stop acquisition; safe to call in any state."""


class GeneratorState(StrEnum):
    """State of the pulse generator as it reports it."""

    SAFE = "safe"
    ARMED = "armed"
    FAULT = "fault"
    LIT = "lit"


class TriggerSource(StrEnum):
    """What starts the shots of an armed pulse generator."""

    COMMAND = "command"
    EXTERNAL = "external"
    TIMER = "timer"


@dataclass(frozen=True)
class GeneratorStatus:
    """Answer of the pulse generator to a status request.

    Parameters
    ----------
    state : GeneratorState
        SAFE, ARMED, FAULT or LIT, which is continuous light.
    faults : tuple[str, ...]
        Names of the latched faults.
    interlock_closed : bool
        The generator's own interlock input.
    shots_left : int
        Shot budget that remains.
    counters : Mapping[str, int]
        ``requested, fired, suppressed, early, cameras, lights``, and of the line ``crc_errors, framing, breaks,
        overruns, lost``; since boot.
    estop_closed : bool
        The generator's own emergency stop.
    """

    state: GeneratorState
    faults: tuple[str, ...]
    interlock_closed: bool
    shots_left: int
    counters: Mapping[str, int]
    estop_closed: bool = True


class PulseGenerator(Device, Protocol):
    """The microcontroller that fires the LED driver and triggers the cameras."""

    def configure(self, timing: ShotTiming) -> FiredTrain:
        """Load a pulse train; returns the actual, quantised one (sequence 0). Refused while armed."""

    def arm(self, shots: int, source: TriggerSource = TriggerSource.COMMAND, period_us: int = 0) -> int:
        """Permit this many shots, not one more, to one source; returns the shortest period of the loaded train, in us.

        The period is the timer's; for the other sources the shortest that is intended, 0 if that is not known. One that
        the loaded train does not permit is refused.
        """

    def fire(self) -> FiredTrain:
        """Fire one shot; returns what was really fired."""

    def status(self) -> GeneratorStatus:
        """State, faults, counters; also the host heartbeat."""

    def light(self, current_a: Mapping[str, float], time_s: float) -> None:
        """Continuous light of low current on these views, for this time at most; the heartbeat keeps it on."""

    def off(self) -> None:
        """Light off, disarm; may be called from any thread at any time, and never waits for another command.

        Returns when the generator itself has confirmed that it is disarmed and dark; DeviceError if it does not.
        """

    def clear(self) -> None:
        """Acknowledge latched faults; the generator stays SAFE."""

    def recover(self) -> None:
        """Open the port again if it hung up, as at first: light off, limits checked; DeviceError if that fails.

        Another board than before is refused. What was armed is not armed again.
        """


class Interlock(Device, Protocol):
    """The laboratory's door and enclosure switches."""

    def is_closed(self) -> bool:
        """True while light is allowed."""

    def wait_for_change(self, deadline_s: float) -> bool:
        """Wait for the next edge; False if there was none within the deadline."""


class TranslationStage(Device, Protocol):
    """The stage that carries the calibration target along z."""

    @property
    def range_mm(self) -> tuple[float, float]:
        """Lowest and highest position."""

    def move_to(self, z_mm: float) -> float:
        """Move, wait until it stands, return the actual position in mm."""

    def position_mm(self) -> float:
        """Actual position."""

    def recover(self) -> None:
        """Open the port again if it hung up; DeviceError if that fails, or another stage is there."""


@dataclass(frozen=True)
class Rig:
    """All devices of one rig.

    Parameters
    ----------
    cameras : Mapping[str, Camera]
        Cameras by view.
    generator, interlock : PulseGenerator, Interlock
        Light and its permission.
    stage : TranslationStage | None
        Carries the calibration target, where there is one.
    max_current_a : Mapping[str, float]
        Limit of each view's LED; a view that is not named has only the limit of the generator.
    network : Network
        The wires between cameras and computer.
    """

    cameras: Mapping[str, Camera]
    generator: PulseGenerator
    interlock: Interlock
    stage: TranslationStage | None = None
    max_current_a: Mapping[str, float] = field(default_factory=dict)
    network: Network = field(default_factory=Network)

    @property
    def devices(self) -> tuple[Device, ...]:
        """All of them, in the order in which they are opened.

        The generator comes last and so is closed first: the light goes off before anything else ends.
        """
        stages = () if self.stage is None else (self.stage,)
        return (*stages, *self.cameras.values(), self.interlock, self.generator)
