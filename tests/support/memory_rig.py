"""A rig in memory: no wires, but honest devices. What the generator fires is what the cameras see."""

import threading
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from daq.devices import DeviceIdentity, GeneratorState, GeneratorStatus, Rig, TriggerSource
from daq.errors import DeviceRefused, InterlockOpen
from daq.faults import Fault
from daq.shot import DoubleFrame, ExposureRecord, FiredTrain, Image, LightPulse
from daq.timing import CameraTiming, ShotTiming
from server.rig.config import RigConfig

SHAPE = (96, 128)
VIEWS = ("view1", "view2")
TIMING = CameraTiming(
    trigger_delay_ns=1000,
    exposure_a_ns=8000,
    gap_ns=2000,
    exposure_b_ns=20_000_000,
    readout_ns=1_000_000,
)


class _MemoryDevice:
    def __init__(self, name: str) -> None:
        self.name = name

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        pass

    def identity(self) -> DeviceIdentity:
        return DeviceIdentity("tomoshadow", "memory", self.name, "1")


class MemoryCamera(_MemoryDevice):
    """Sees two discs before a lit background, and nothing in the dark."""

    timing = TIMING
    image_shape = SHAPE
    bits = 8
    is_lost = False

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.misses_next = False
        self._exposed = threading.Event()
        self._lit = (False, False)
        self._frame_id = 0
        self._latest: Image | None = None

    def arm(self) -> None:
        self._exposed.clear()

    def begin_shot(self) -> None:
        self._exposed.clear()

    def expose(self, pulses: tuple[LightPulse, ...]) -> None:
        self._lit = (len(pulses) > 0, len(pulses) > 1)
        self._frame_id += 2
        self._exposed.set()

    def collect(self, deadline_s: float) -> DoubleFrame:
        arrived = self._exposed.wait(deadline_s) and not self.misses_next
        self.misses_next = False
        image_a, image_b = (self._image(lit and arrived, number) for number, lit in enumerate(self._lit))
        self._latest = image_b
        record = ExposureRecord(arrived, self._frame_id if arrived else 0, self._frame_id * 1000 if arrived else 0)
        return DoubleFrame(image_a, image_b, record, record)

    def disarm(self) -> None:
        self._exposed.clear()

    def latest(self) -> Image | None:
        return self._latest

    def _image(self, lit: bool, number: int) -> Image:
        rows, columns = np.indices(SHAPE)
        if not lit:
            return np.zeros(SHAPE, np.uint8)
        image = np.full(SHAPE, 200, np.uint8) - (columns // 8).astype(np.uint8)
        for row, column in ((30, 40), (60, 90)):
            image[np.hypot(rows - row - 6 * number, columns - column) < 9] = 40
        return image


class MemoryGenerator(_MemoryDevice):
    """Fires what it was configured for, while it is armed and the door is closed."""

    def __init__(self, name: str, cameras: Mapping[str, MemoryCamera], interlock: "MemoryDoor") -> None:
        super().__init__(name)
        self._cameras = cameras
        self._interlock = interlock
        self._lock = threading.Lock()
        self._train = FiredTrain(0)
        self._shots_left = 0
        self._sequence = 0

    def configure(self, timing: ShotTiming) -> FiredTrain:
        triggers = {name: view.camera_trigger_ns for name, view in timing.views.items()}
        pulses = {
            name: tuple(
                LightPulse(pulse.open_ns, pulse.close_ns - pulse.open_ns, view.current_a)
                for pulse in (view.pulse_a, view.pulse_b)
                if view.current_a > 0
            )
            for name, view in timing.views.items()
        }
        self._train = FiredTrain(0, triggers, pulses)
        return self._train

    def light(self, current_a: Mapping[str, float], time_s: float) -> None:
        raise DeviceRefused(self.name, f"no continuous light: {dict(current_a)} for {time_s} s")

    def arm(self, shots: int, source: TriggerSource = TriggerSource.COMMAND, period_us: int = 0) -> None:
        if not self._interlock.is_closed():
            raise InterlockOpen("the door is open")
        with self._lock:
            self._shots_left = shots

    def fire(self) -> FiredTrain:
        with self._lock:
            if self._shots_left == 0:
                raise DeviceRefused(self.name, "not armed")
            self._shots_left -= 1
            self._sequence += 1
        train = FiredTrain(self._sequence, self._train.camera_trigger_ns, self._train.pulses)
        for name, camera in self._cameras.items():
            camera.expose(train.pulses[name])
        return train

    def status(self) -> GeneratorStatus:
        state = GeneratorState.ARMED if self._shots_left else GeneratorState.SAFE
        counters = {"requested": self._sequence, "fired": self._sequence, "suppressed": 0, "early": 0, "crc_errors": 0}
        return GeneratorStatus(state, (), self._interlock.is_closed(), self._shots_left, counters)

    def off(self) -> None:
        with self._lock:
            self._shots_left = 0

    def clear(self) -> None:
        self.off()


class MemoryDoor(_MemoryDevice):
    """The interlock: a door that tests open."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._closed = True
        self._changed = threading.Condition()

    def is_closed(self) -> bool:
        return self._closed

    def wait_for_change(self, deadline_s: float) -> bool:
        with self._changed:
            return self._changed.wait(deadline_s)

    def move(self, *, closed: bool) -> None:
        with self._changed:
            self._closed = closed
            self._changed.notify_all()


class MemoryLaboratory:
    """The rig, and what surrounds it."""

    def __init__(self, views: tuple[str, ...] = VIEWS) -> None:
        self.cameras = {view: MemoryCamera(view) for view in views}
        self.door = MemoryDoor("interlock")
        self.generator = MemoryGenerator("pulse generator", self.cameras, self.door)
        self.rig = Rig(self.cameras, self.generator, self.door)

    def open_door(self) -> None:
        self.door.move(closed=False)

    def close_door(self) -> None:
        self.door.move(closed=True)

    def inject(self, fault: Fault) -> None:
        if fault.view not in self.cameras:
            raise ValueError(f"there is no view {fault.view}")
        self.cameras[fault.view].misses_next = True


def memory_config(data_dir: Path, views: tuple[str, ...] = VIEWS, token: str | None = None) -> RigConfig:
    """Configuration of such a rig; lens and sensor are those of nobody."""
    profile = data_dir.parent / "profile.toml"
    profile.touch()
    return RigConfig.model_validate(
        {
            "name": "rig in memory",
            "views": {
                view: {
                    "azimuth_deg": 15 - 30 * number,
                    "camera": {"ip": f"127.0.9.{number + 1}", "profile": str(profile)},
                    "led_channel": number,
                    "lens": {"f_number": 16, "focal_length_mm": 85, "magnification": 0.44},
                    "sensor": {"pixel_pitch_um": 7.4, "width_px": SHAPE[1], "height_px": SHAPE[0]},
                    "max_current_a": 12.0,
                    "nominal_current_a": 10.0,
                }
                for number, view in enumerate(views)
            },
            "server": {"data_dir": str(data_dir), "token": token},
            "simulation": {},
        },
        context={"folder": data_dir.parent},
    )
