"""Devices in memory: they keep their Protocol honestly, see ``tests/contract``, and fail when a test tells them to."""

import threading
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from types import TracebackType
from typing import Self

import numpy as np

from daq.devices import DeviceIdentity, GeneratorState, GeneratorStatus, TriggerSource
from daq.drivers.pulse_protocol import COUNTERS
from daq.errors import DeviceError, DeviceRefused, DeviceTimeout, DeviceUnavailable, PlanError
from daq.files.run_directory import ViewFormat
from daq.shot import DoubleFrame, ExposureRecord, FiredTrain, Image, LightPulse
from daq.simulation.camera.light import Exposure, FrameSource, exposures_of
from daq.timing import CameraTiming, ShotTiming

TICK_NS = 8
DUTY = 200e-6
MAX_SHOTS = 1_000_000
MAX_LIGHT_A = 0.5


class MemoryDevice:
    """Name, identity, and a life without meaning; ``journal`` is shared by all devices of a rig. It is never lost.

    ``mute`` lets it give no answer when it is asked who it is, and ``serial`` is what it answers.
    """

    def __init__(self, name: str, journal: list[str]) -> None:
        self.name = name
        self.journal = journal
        self.mute = False
        self.serial = name

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Nothing is held."""

    def identity(self) -> DeviceIdentity:
        if self.mute:
            raise DeviceTimeout(self.name, "identity", 0.5)
        return DeviceIdentity("tomoshadow", "memory", self.serial, "1")

    def recover(self) -> None:
        """Nothing was lost."""


class MemoryCamera(MemoryDevice):
    """Sees its scene by the light that falls into its exposures.

    ``lost`` names the firings, from 1, of which exposure B is lost; ``broken_at`` the firing at which it dies;
    ``frozen`` lets collect and disarm hang until the event is set, ``clock`` begin_shot. ``silent_at`` names
    firings of which nothing comes; from ``dead_from`` on nothing comes, and it does not answer.
    """

    def __init__(
        self, name: str, journal: list[str], scene: FrameSource, view_format: ViewFormat, timing: CameraTiming
    ) -> None:
        super().__init__(name, journal)
        self.timing = timing
        self.image_shape = view_format.shape
        self.bits = view_format.bits
        self.is_lost = self.has_half = False
        self.lost: set[int] = set()
        self.broken_at: int | None = None
        self.frozen: threading.Event | None = None
        self.silent_at: set[int] = set()
        self.dead_from: int | None = None
        self.clock: threading.Event | None = None
        self._scene = scene
        self._frames = 0
        self._armed = False
        self._train: FiredTrain | None = None
        self._triggered = threading.Event()

    def ask(self) -> None:
        self.journal.append(f"{self.name} ask")
        if self.is_lost or self.frozen or self._is_dead:
            raise DeviceUnavailable(self.name, "does not answer")

    def recover(self) -> None:
        if self.is_lost:
            self.ask()

    def arm(self) -> None:
        self.journal.append(f"{self.name} arm")
        self._armed = True
        self.begin_shot()

    def begin_shot(self) -> None:
        self._check_armed()
        if self.clock:
            self.clock.wait(5)
        self._train = None
        self._triggered.clear()

    def trigger(self, train: FiredTrain) -> None:
        self._train = train
        self._triggered.set()

    def collect(self, deadline_s: float) -> DoubleFrame:
        self._check_armed()
        if self.frozen:
            self.frozen.wait(deadline_s)
            return self._double_frame(None, None)
        if not self._triggered.wait(deadline_s) or self._train is None or self._is_silent:
            return self._double_frame(None, None)
        if self._train.sequence == self.broken_at:
            raise DeviceError(self.name, "control lost")
        first, second = exposures_of(self._train, self.name, self.timing, self.image_shape, self.bits)
        return self._double_frame(first, None if self._train.sequence in self.lost else second)

    def disarm(self) -> None:
        self.journal.append(f"{self.name} disarm")
        self._armed = False
        if self.frozen:
            self.frozen.wait(5)

    @property
    def _is_dead(self) -> bool:
        return self.dead_from is not None and self._train is not None and self._train.sequence >= self.dead_from

    @property
    def _is_silent(self) -> bool:
        return self._is_dead or (self._train is not None and self._train.sequence in self.silent_at)

    def _check_armed(self) -> None:
        if not self._armed:
            raise DeviceError(self.name, "the camera is not armed")

    def _double_frame(self, first: Exposure | None, second: Exposure | None) -> DoubleFrame:
        (image_a, record_a), (image_b, record_b) = self._expose(first), self._expose(second)
        return DoubleFrame(image_a, image_b, record_a, record_b)

    def _expose(self, exposure: Exposure | None) -> tuple[Image, ExposureRecord]:
        if exposure is None:
            nothing = np.zeros(self.image_shape, np.uint16)
            return nothing.astype(np.uint8) if self.bits == 8 else nothing, ExposureRecord(valid=False)
        self._frames += 1
        return self._scene(exposure), ExposureRecord(True, self._frames, 1000 * self._frames)


class MemoryGenerator(MemoryDevice):
    """Fires what it has loaded while it is armed, and no shot before its duty permits it.

    ``unlit`` names the firings without their second pulse, ``silent_at`` the one that it does not answer;
    ``stuck`` lets it ignore ``off``; ``wrong_echo_ns`` shifts the second pulse of what it loads; ``restarted`` lets the
    next status say that it was reset, which is then a fault until it is cleared.
    """

    def __init__(
        self, name: str, journal: list[str], views: Iterable[str], on_fired: Callable[[FiredTrain], None]
    ) -> None:
        super().__init__(name, journal)
        self.state = GeneratorState.SAFE
        self.unlit: set[int] = set()
        self.silent_at: int | None = None
        self.stuck = False
        self.restarted = False
        self.wrong_echo_ns = 0
        self.counters = dict.fromkeys(COUNTERS, 0)
        self._views = tuple(views)
        self._on_fired = on_fired
        self._faults: tuple[str, ...] = ()
        self._interlock_closed = True
        self._loaded: FiredTrain | None = None
        self._shots_left = 0
        self._light_a: dict[str, float] = {}
        self._dark_at_s = self._ready_at_s = 0.0
        self._skipped_s = 0.0

    @property
    def fired(self) -> int:
        """Shots so far."""
        return self.counters["fired"]

    @property
    def light_a(self) -> dict[str, float]:
        """Continuous light that is on."""
        self._end_light()
        return self._light_a if self.state is GeneratorState.LIT else {}

    def set_interlock(self, closed: bool) -> None:
        self._interlock_closed = closed
        if not closed and self.state in (GeneratorState.ARMED, GeneratorState.LIT):
            self.trip("interlock")

    def trip(self, fault: str) -> None:
        self.state, self._faults, self._shots_left = GeneratorState.FAULT, (fault,), 0

    def advance(self, time_ms: float) -> None:
        """Let time pass at once."""
        self._skipped_s += time_ms / 1000

    def configure(self, timing: ShotTiming) -> FiredTrain:
        self._check_safe()
        self._loaded = None
        self._check_views(timing.views)
        if late := [name for name, view in timing.views.items() if view.pulse_a.close_ns > view.frame_a.close_ns]:
            raise DeviceRefused(self.name, f"frame A closes before pulse A ends: {late}")
        shift_ns = TICK_NS * (1 + max(0, *(-view.camera_trigger_ns for view in timing.views.values())) // TICK_NS)
        triggers = {name: _ticks(view.camera_trigger_ns + shift_ns) for name, view in timing.views.items()}
        self._loaded = FiredTrain(0, triggers, {name: self._pulses(timing, name, shift_ns) for name in timing.views})
        return self._loaded

    def light(self, current_a: Mapping[str, float], time_s: float) -> None:
        self._check_views(current_a)
        self._check_safe()
        if not all(0 < current <= MAX_LIGHT_A for current in current_a.values()):
            raise DeviceRefused(self.name, f"continuous light is not 10 to 500 mA: {dict(current_a)}")
        self.state, self._light_a, self._dark_at_s = GeneratorState.LIT, dict(current_a), self._now_s() + time_s

    def arm(self, shots: int, source: TriggerSource = TriggerSource.COMMAND, period_us: int = 0) -> int:
        self._check_safe()
        if self._loaded is None:
            raise DeviceRefused(self.name, "there is no pulse train")
        if not 0 < shots <= MAX_SHOTS:
            raise DeviceRefused(self.name, f"shot budget {shots} is not 1 to {MAX_SHOTS}")
        if source is not TriggerSource.COMMAND:
            raise DeviceRefused(self.name, f"nobody else can trigger: {source}")
        if not self._interlock_closed:
            raise DeviceRefused(self.name, "the interlock is open")
        self.journal.append(f"arm {shots}")
        self.state, self._shots_left = GeneratorState.ARMED, shots
        return round(1e6 * _shortest_s(self._loaded))

    def fire(self) -> FiredTrain:
        self.counters["requested"] += 1
        if self.state is not GeneratorState.ARMED or self._loaded is None:
            self.counters["suppressed"] += 1
            raise DeviceRefused(self.name, f"not armed but {self.state}")
        if self._now_s() < self._ready_at_s:
            self.counters["suppressed"] += 1
            self.counters["early"] += 1
            raise DeviceRefused(self.name, "before the shortest period is over")
        return self._fire(self._loaded)

    def status(self) -> GeneratorStatus:
        if self.restarted:
            self.restarted = False
            self.trip("restarted")
            raise DeviceError(self.name, "the microcontroller was reset")
        self._end_light()
        return GeneratorStatus(self.state, self._faults, self._interlock_closed, self._shots_left, dict(self.counters))

    def off(self) -> None:
        self.journal.append("off")
        if self.stuck:
            return
        self._shots_left = 0
        if self.state is not GeneratorState.FAULT:
            self.state = GeneratorState.SAFE

    def clear(self) -> None:
        if not self._interlock_closed:
            raise DeviceRefused(self.name, "the interlock is open")
        if self.state is GeneratorState.FAULT:
            self.state, self._faults = GeneratorState.SAFE, ()

    def _fire(self, loaded: FiredTrain) -> FiredTrain:
        self.counters["fired"] += 1
        self.counters["cameras"] += len(loaded.camera_trigger_ns)
        self.counters["lights"] += sum(bool(pulses) for pulses in loaded.pulses.values())
        self._shots_left -= 1
        if not self._shots_left:
            self.state = GeneratorState.SAFE
        self._ready_at_s = self._now_s() + _shortest_s(loaded)
        if self.fired == self.silent_at:
            raise DeviceTimeout(self.name, "fire", 0.5)
        self.journal.append(f"fire {self.fired}")
        train = replace(loaded, sequence=self.fired)
        pulses = {view: lit[:1] for view, lit in train.pulses.items()} if self.fired in self.unlit else train.pulses
        self._on_fired(replace(train, pulses=pulses))
        return train

    def _pulses(self, timing: ShotTiming, name: str, shift_ns: int) -> tuple[LightPulse, ...]:
        view = timing.views[name]
        if not view.current_a:
            return ()
        starts_ns = (view.pulse_a.open_ns, view.pulse_b.open_ns + self.wrong_echo_ns)
        widths_ns = (pulse.close_ns - pulse.open_ns for pulse in (view.pulse_a, view.pulse_b))
        return tuple(
            LightPulse(_ticks(start_ns + shift_ns), _ticks(width_ns), view.current_a)
            for start_ns, width_ns in zip(starts_ns, widths_ns, strict=True)
            if width_ns
        )

    def _check_safe(self) -> None:
        self._end_light()
        if self.state is GeneratorState.FAULT:
            raise DeviceRefused(self.name, f"a fault is latched: {self._faults}")
        if self.state is not GeneratorState.SAFE:
            raise DeviceRefused(self.name, "armed or lit")

    def _check_views(self, views: Iterable[str]) -> None:
        if unknown := set(views) - set(self._views):
            raise PlanError(f"{self.name} has no channel for {sorted(unknown)}")

    def _end_light(self) -> None:
        if self.state is GeneratorState.LIT and self._now_s() >= self._dark_at_s:
            self.state = GeneratorState.SAFE

    def _now_s(self) -> float:
        return time.monotonic() + self._skipped_s


class MemoryStage(MemoryDevice):
    """Moves at once, never while the generator could fire, and stands a micrometre beside where it was sent."""

    def __init__(
        self,
        name: str,
        journal: list[str],
        generator: MemoryGenerator,
        range_mm: tuple[float, float] = (-10.0, 10.0),
    ) -> None:
        super().__init__(name, journal)
        self.range_mm = range_mm
        self._generator = generator
        self._z_mm = 0.0

    def move_to(self, z_mm: float) -> float:
        low_mm, high_mm = self.range_mm
        if not low_mm <= z_mm <= high_mm:
            raise DeviceRefused(self.name, f"z {z_mm:g} mm is outside the range {low_mm:g} to {high_mm:g} mm")
        assert self._generator.state is not GeneratorState.ARMED
        self.journal.append(f"move {z_mm:g}")
        self._z_mm = z_mm + 0.001
        return self._z_mm

    def position_mm(self) -> float:
        return self._z_mm


def _shortest_s(loaded: FiredTrain) -> float:
    lit_ns = max(sum(pulse.width_ns for pulse in pulses) for pulses in loaded.pulses.values())
    return lit_ns / 1e9 / DUTY


def _ticks(time_ns: int) -> int:
    return TICK_NS * round(time_ns / TICK_NS)
