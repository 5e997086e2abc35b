"""The scene of a simulated rig: the views of its configuration, as imperfect as real ones, and the truth of them."""

import threading
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from daq.run_plan import RunKind
from daq.shot import FiredTrain, Image
from daq.simulation.camera.light import Exposure
from processing.geometry import PinholeCamera, view_camera
from processing.optics import image_scale_px_per_mm
from processing.synthetic.liquid.nozzles import flat_fan_spray, hollow_cone_spray
from processing.synthetic.numbered import ImageNumber, numbered
from processing.synthetic.scene import Pulse, Scene
from processing.synthetic.target import Checkerboard, DotTarget
from processing.synthetic.truth_file import FiredSpray
from processing.synthetic.view_optics import ViewOptics
from server.rig.config import RigConfig, TargetConfig, ViewConfig

SPRAYS = {"hollow_cone": hollow_cone_spray, "flat_fan": flat_fan_spray}

SCHEIMPFLUG_MM_PER_DEG = 0.03
"""Shift of the optical axis on the sensor that a Scheimpflug adaptor brings, per degree of viewing angle."""


RENDERING_THREADS = 2
"""Rendering holds the interpreter lock for much of its time: four cameras at once take twice as long as two."""


class SimulatedScene:
    """What stands before the cameras, as cameras and acquisition ask for it.

    Parameters
    ----------
    config : RigConfig
        A rig with a simulation.
    stage_z_mm : Callable[[], float]
        True position of the target.
    """

    def __init__(self, config: RigConfig, stage_z_mm: Callable[[], float]) -> None:
        if config.simulation is None:
            raise ValueError(f"rig {config.name}: has no [simulation]")
        simulation = config.simulation
        self._scene = Scene(
            true_cameras(config, simulation.seed),
            {name: _optics(view) for name, view in config.views.items()},
            seed=simulation.seed,
            spray_factory=SPRAYS[simulation.spray],
            target=_target(config.target),
            stage_z_mm=stage_z_mm,
        )
        self._numbered, self._views = simulation.numbered, list(config.views)
        self._keeps = simulation.still
        self._still: dict[tuple[str, str, int], Image] = {}
        self._rendering = threading.BoundedSemaphore(RENDERING_THREADS)

    def prepare(self, kind: RunKind) -> None:
        """Play the operator before a run: spray on or off, target in."""
        self._scene.prepare(kind.value)

    def expose(self, exposure: Exposure) -> Image:
        """Image of one exposure: the frame source of every camera."""
        pulses = [(pulse.start_ns, pulse.collected_ns, pulse.current_a) for pulse in exposure.pulses]
        with self._rendering:
            image = self._render(exposure, pulses)
        if not self._numbered:
            return image
        number = ImageNumber(exposure.sequence, self._views.index(exposure.view), exposure.frame)
        return numbered(image, number, exposure.bits)

    def _render(self, exposure: Exposure, pulses: Sequence[Pulse]) -> Image:
        which = (exposure.view, exposure.frame, len(pulses))
        if which not in self._still:
            sequence = self._shown(exposure.sequence)
            image = self._scene.render(exposure.view, sequence, exposure.frame, pulses, exposure.shape, exposure.bits)
            if not self._keeps:
                return image
            self._still[which] = image
        return self._still[which]

    @property
    def cameras(self) -> Mapping[str, PinholeCamera]:
        """True cameras by view."""
        return self._scene.cameras

    def liquid(self, train: FiredTrain) -> FiredSpray:
        """What the nozzle gives, where it is open, at the middle of the first light pulse of a firing."""
        time_ns = _first_light_ns(train)
        return FiredSpray(time_ns, self._scene.truth(self._shown(train.sequence), time_ns))

    def _shown(self, sequence: int) -> int:
        """The firing whose liquid is seen at that one: where nothing moves, always the same."""
        return 1 if self._keeps else sequence


def true_cameras(config: RigConfig, seed: int) -> dict[str, PinholeCamera]:
    """Cameras of a rig as they really stand: a little rolled and pitched, with distortion and a shifted axis.

    The distortion, drawn by the seed, is 1 to 3 px in the corners of an image of 1600 x 1200.
    """
    random = np.random.default_rng([seed, 4])
    return {name: _true_camera(view, random) for name, view in config.views.items()}


def _true_camera(view: ViewConfig, random: np.random.Generator) -> PinholeCamera:
    radial = random.uniform(0.4, 0.7) * random.choice([-1, 1])
    distortion = np.array([radial, random.uniform(0, 20), *random.uniform(-1e-3, 1e-3, 2), 0.0])
    pixels_per_mm = 1000 / view.sensor.pixel_pitch_um
    return view_camera(
        view.azimuth_deg,
        focal_length_mm=view.lens.focal_length_mm,
        magnification=view.lens.magnification,
        scale_px_per_mm=image_scale_px_per_mm(view.lens.magnification, view.sensor.pixel_pitch_um),
        image_size_px=(view.sensor.width_px, view.sensor.height_px),
        pitch_deg=random.uniform(-0.5, 0.5),
        roll_deg=view.roll_deg + random.uniform(-0.5, 0.5),
        distortion=distortion,
        principal_offset_px=(
            view.azimuth_deg * SCHEIMPFLUG_MM_PER_DEG * pixels_per_mm,
            random.uniform(-0.15, 0.15) * pixels_per_mm,
        ),
    )


def _optics(view: ViewConfig) -> ViewOptics:
    lens = view.lens
    return ViewOptics(
        lens.f_number, lens.focal_length_mm, lens.magnification, view.sensor.pixel_pitch_um, view.nominal_current_a
    )


def _target(target: TargetConfig) -> Checkerboard | DotTarget:
    if target.kind == "dots":
        return DotTarget(target.columns, target.rows, target.pitch_mm, diameter_mm=0.4 * target.pitch_mm)
    return Checkerboard(target.columns, target.rows, target.pitch_mm)


def _first_light_ns(train: FiredTrain) -> int:
    pulses = [pulse for view in train.pulses.values() for pulse in view]
    first = min(pulses, key=lambda pulse: pulse.start_ns, default=None)
    return 0 if first is None else first.start_ns + first.width_ns // 2
