"""A bench in memory: devices that keep their Protocol honestly, and fail when a test tells them to."""

import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from daq.devices import DeviceIdentity, GeneratorState, GeneratorStatus, Rig, TriggerSource
from daq.errors import DeviceError, DeviceRefused, DeviceTimeout
from daq.files.run_directory import RunReader
from daq.run_plan import RunPlan
from daq.shot import DoubleFrame, ExposureRecord, FiredTrain, Image, LightPulse
from daq.simulation.camera.light import Exposure, exposures_of
from daq.simulation.interlock import MemoryInterlock
from daq.timing import CameraTiming, ShotTiming

TIMING = CameraTiming(
    trigger_delay_ns=1000, exposure_a_ns=20_000, gap_ns=2000, exposure_b_ns=2_000_000, readout_ns=1_000_000
)
SHAPE = (24, 32)
DARK_COUNTS, LIT_COUNTS = 4, 120


class MemoryDevice:
    """Name, identity, and a life without meaning; ``journal`` is shared by all devices of a bench."""

    def __init__(self, name: str, journal: list[str]) -> None:
        self.name = name
        self.journal = journal

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Nothing is held."""

    def identity(self) -> DeviceIdentity:
        return DeviceIdentity("tests", type(self).__name__, self.name, "1")


class MemoryCamera(MemoryDevice):
    """Renders a flat field from the light that falls into its exposures.

    ``lost`` names the firings, from 1, of which exposure B is lost; ``broken_at`` the firing at which it dies;
    ``frozen`` lets collect and disarm hang until the event is set.
    """

    def __init__(self, name: str, journal: list[str], shape: tuple[int, int] = SHAPE, bits: int = 8) -> None:
        super().__init__(name, journal)
        self.timing = TIMING
        self.image_shape = shape
        self.bits = bits
        self.is_lost = False
        self.lost: set[int] = set()
        self.broken_at: int | None = None
        self.frozen: threading.Event | None = None
        self.frames = 0
        self._train: FiredTrain | None = None
        self._triggered = threading.Event()

    def arm(self) -> None:
        self.journal.append(f"{self.name} arm")

    def begin_shot(self) -> None:
        self._train = None
        self._triggered.clear()

    def trigger(self, train: FiredTrain) -> None:
        self._train = train
        self._triggered.set()

    def collect(self, deadline_s: float) -> DoubleFrame:
        if self.frozen:
            self.frozen.wait(deadline_s)
            return self._double_frame(None, None)
        if not self._triggered.wait(deadline_s) or self._train is None:
            return self._double_frame(None, None)
        if self._train.sequence == self.broken_at:
            raise DeviceError(self.name, "control lost")
        exposures = exposures_of(self._train, self.name, self.timing, self.image_shape, self.bits)
        lost = self._train.sequence in self.lost
        return self._double_frame(exposures[0], None if lost else exposures[1])

    def disarm(self) -> None:
        self.journal.append(f"{self.name} disarm")
        if self.frozen:
            self.frozen.wait(5)

    def latest(self) -> Image | None:
        return None

    def _double_frame(self, first: Exposure | None, second: Exposure | None) -> DoubleFrame:
        (image_a, record_a), (image_b, record_b) = self._expose(first), self._expose(second)
        return DoubleFrame(image_a, image_b, record_a, record_b)

    def _expose(self, exposure: Exposure | None) -> tuple[Image, ExposureRecord]:
        image = np.zeros(self.image_shape, np.uint8 if self.bits == 8 else np.uint16)
        if exposure is None:
            return image, ExposureRecord(valid=False)
        self.frames += 1
        counts = DARK_COUNTS + sum(LIT_COUNTS * (pulse.current_a > 0) for pulse in exposure.pulses)
        image += counts << (self.bits - 8)
        image[0, 0] += self.frames % 3
        return image, ExposureRecord(True, self.frames, 1000 * self.frames)


class MemoryGenerator(MemoryDevice):
    """Arms for so many shots, fires while armed, forgets its train when switched off.

    ``unlit`` names the firings without their second pulse, ``silent_at`` the one that it does not answer;
    ``stuck`` lets it ignore ``off``; ``wrong_echo_ns`` shifts the second pulse of what it loads.
    """

    def __init__(self, name: str, journal: list[str], on_fired: Callable[[FiredTrain], None]) -> None:
        super().__init__(name, journal)
        self.state = GeneratorState.SAFE
        self.faults: tuple[str, ...] = ()
        self.interlock_closed = True
        self.unlit: set[int] = set()
        self.silent_at: int | None = None
        self.stuck = False
        self.wrong_echo_ns = 0
        self.fired = 0
        self.shots_left = 0
        self._loaded: FiredTrain | None = None
        self._on_fired = on_fired

    def configure(self, timing: ShotTiming) -> FiredTrain:
        if self.state is not GeneratorState.SAFE:
            raise DeviceRefused(self.name, f"configure while {self.state.value}")
        shift_ns = 1000 - min(view.camera_trigger_ns for view in timing.views.values())
        pulses = {}
        for name, view in timing.views.items():
            starts_ns = (view.pulse_a.open_ns, view.pulse_b.open_ns + self.wrong_echo_ns)
            width_ns = view.pulse_a.close_ns - view.pulse_a.open_ns
            pulses[name] = tuple(LightPulse(start + shift_ns, width_ns, view.current_a) for start in starts_ns)
        triggers = {name: view.camera_trigger_ns + shift_ns for name, view in timing.views.items()}
        self._loaded = FiredTrain(0, triggers, pulses)
        return self._loaded

    def light(self, current_a: Mapping[str, float], time_s: float) -> None:
        raise DeviceRefused(self.name, f"no continuous light: {dict(current_a)} for {time_s} s")

    def arm(self, shots: int, source: TriggerSource = TriggerSource.COMMAND, period_us: int = 0) -> None:
        if self._loaded is None or self.state is GeneratorState.FAULT:
            raise DeviceRefused(self.name, f"arm while {self.state.value}, train {self._loaded}")
        self.journal.append(f"arm {shots}")
        self.state, self.shots_left = GeneratorState.ARMED, shots

    def fire(self) -> FiredTrain:
        if self.state is not GeneratorState.ARMED or not self.shots_left or self._loaded is None:
            raise DeviceRefused(self.name, f"fire while {self.state.value}, {self.shots_left} shots left")
        self.fired += 1
        self.shots_left -= 1
        if self.fired == self.silent_at:
            raise DeviceTimeout(self.name, "fire", 0.5)
        self.journal.append(f"fire {self.fired}")
        train = replace(self._loaded, sequence=self.fired)
        pulses = {view: lit[:1] for view, lit in train.pulses.items()} if self.fired in self.unlit else train.pulses
        self._on_fired(replace(train, pulses=pulses))
        return train

    def status(self) -> GeneratorStatus:
        return GeneratorStatus(self.state, self.faults, self.interlock_closed, self.shots_left, {})

    def off(self) -> None:
        self.journal.append("off")
        if self.stuck:
            return
        self._loaded = None
        if self.state is GeneratorState.ARMED:
            self.state = GeneratorState.SAFE

    def trip(self, fault: str) -> None:
        self.state, self.faults = GeneratorState.FAULT, (fault,)

    def clear(self) -> None:
        if self.state is GeneratorState.FAULT:
            self.state, self.faults = GeneratorState.SAFE, ()


class MemoryStage(MemoryDevice):
    """Moves at once; notes whether the generator could have fired meanwhile."""

    range_mm = (-10.0, 10.0)

    def __init__(self, name: str, journal: list[str], generator: MemoryGenerator) -> None:
        super().__init__(name, journal)
        self._generator = generator
        self._z_mm = 0.0

    def move_to(self, z_mm: float) -> float:
        assert self._generator.state is not GeneratorState.ARMED
        self.journal.append(f"move {z_mm:g}")
        self._z_mm = z_mm + 0.001
        return self._z_mm

    def position_mm(self) -> float:
        return self._z_mm


class MemoryBench:
    """Two cameras of different format, generator, interlock, stage: a rig, and handles to break it."""

    def __init__(self) -> None:
        self.journal: list[str] = []
        self.cameras = {
            "view1": MemoryCamera("view1", self.journal),
            "view2": MemoryCamera("view2", self.journal, (16, 40), 12),
        }
        self.generator = MemoryGenerator("generator", self.journal, self._fired)
        self.interlock = MemoryInterlock("door")
        self.interlock.close_door()
        self.stage = MemoryStage("stage", self.journal, self.generator)
        self.rig = Rig(
            self.cameras,
            self.generator,
            self.interlock,
            self.stage,
            max_current_a={"view2": 26.0},
        )

    def _fired(self, train: FiredTrain) -> None:
        for camera in self.cameras.values():
            camera.trigger(train)

    def before_run(self, plan: RunPlan) -> None:
        self.journal.append(f"before {plan.kind}")

    def after_run(self, run_dir: Path) -> None:
        self.journal.append(f"after, {RunReader(run_dir).shot_count} shots, {RunReader(run_dir).outcome}")
