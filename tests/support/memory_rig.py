"""A rig in memory: no wires, but honest devices. What the generator fires is what the cameras see."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from daq.devices import Rig
from daq.faults import Fault, FaultKind
from daq.files.run_directory import RunReader, ViewFormat
from daq.run_plan import RunPlan
from daq.shot import FiredTrain, Image
from daq.simulation.camera.light import Exposure, FrameSource
from daq.simulation.interlock import MemoryInterlock
from daq.timing import CameraTiming
from server.rig.config import RigConfig
from tests.support.memory_devices import MemoryCamera, MemoryGenerator, MemoryStage

VIEWS = ("view1", "view2")
SHAPE = (96, 128)
FORMATS = {"view1": ViewFormat((24, 32), 8), "view2": ViewFormat((16, 40), 12)}
TIMING = CameraTiming(
    trigger_delay_ns=1000, exposure_a_ns=20_000, gap_ns=2000, exposure_b_ns=2_000_000, readout_ns=1_000_000
)
DARK_COUNTS, LIT_COUNTS = 4, 120


def flat_field(exposure: Exposure) -> Image:
    """As bright everywhere as its light, but for a corner in which no two frames are alike."""
    counts = DARK_COUNTS + LIT_COUNTS * len(exposure.pulses)
    image = np.full(exposure.shape, counts << (exposure.bits - 8), np.uint8 if exposure.bits == 8 else np.uint16)
    image[0, 0] += (2 * exposure.sequence + (exposure.frame == "B")) % 3
    return image


def two_discs(exposure: Exposure) -> Image:
    """Two discs before a lit background that move down from A to B, and nothing in the dark; 8 bit."""
    if not exposure.pulses:
        return np.zeros(exposure.shape, np.uint8)
    rows, columns = np.indices(exposure.shape)
    image = np.full(exposure.shape, 200, np.uint8) - (columns // 8).astype(np.uint8)
    for row, column in ((30, 40), (60, 90)):
        image[np.hypot(rows - row - 6 * (exposure.frame == "B"), columns - column) < 9] = 40
    return image


class MemoryRig:
    """A rig, what surrounds it, and handles to break it; it observes its runs.

    Parameters
    ----------
    formats : Mapping[str, ViewFormat]
        Frames of every view.
    scene : FrameSource
        What the cameras see.
    timing : CameraTiming
        Of all cameras.
    """

    def __init__(
        self,
        formats: Mapping[str, ViewFormat] = FORMATS,
        scene: FrameSource = flat_field,
        timing: CameraTiming = TIMING,
    ) -> None:
        self.journal: list[str] = []
        self.cameras = {
            view: MemoryCamera(view, self.journal, scene, view_format, timing) for view, view_format in formats.items()
        }
        self.generator = MemoryGenerator("generator", self.journal, formats, self._fired)
        self.interlock = MemoryInterlock("door")
        self.stage = MemoryStage("stage", self.journal, self.generator)
        self.rig = Rig(self.cameras, self.generator, self.interlock, self.stage, max_current_a={"view2": 26.0})
        self.close_door()

    is_apart = False

    def ask(self) -> str:
        return "nobody"

    def open_door(self) -> None:
        self.generator.set_interlock(False)
        self.interlock.open_door()

    def close_door(self) -> None:
        self.generator.set_interlock(True)
        self.interlock.close_door()

    def inject(self, fault: Fault) -> None:
        if fault.view not in self.cameras:
            raise ValueError(f"there is no view {fault.view}")
        assert fault.kind is FaultKind.DROPPED_B
        self.cameras[fault.view].lost.add(self.generator.fired + 1)

    def before_run(self, plan: RunPlan, run_dir: Path | None) -> None:
        self.journal.append(f"before {plan.kind}")

    def after_run(self, run_dir: Path) -> None:
        reader = RunReader(run_dir)
        self.journal.append(f"after, {reader.shot_count} shots, {reader.outcome}")

    def _fired(self, train: FiredTrain) -> None:
        for camera in self.cameras.values():
            camera.trigger(train)


def served_rig(views: tuple[str, ...] = VIEWS) -> MemoryRig:
    """The rig of ``memory_config``: its cameras take 21 ms for a shot."""
    slow = CameraTiming(
        trigger_delay_ns=1000, exposure_a_ns=20_000, gap_ns=2000, exposure_b_ns=20_000_000, readout_ns=1_000_000
    )
    return MemoryRig(dict.fromkeys(views, ViewFormat(SHAPE, 8)), two_discs, slow)


def memory_config(
    data_dir: Path, views: tuple[str, ...] = VIEWS, token: str | None = None, viewer_token: str | None = None
) -> RigConfig:
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
            "server": {"data_dir": str(data_dir), "token": token, "viewer_token": viewer_token},
            "simulation": {},
        },
        context={"folder": data_dir.parent},
    )
