"""Scene: what stands in front of the simulated cameras, rendered for any exposure of any view.

An image is a function of (seed, prepared kind, view, sequence number, frame, light pulses) and of the stage:
camera threads may render at the same time and in any order.
"""

from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from functools import lru_cache
from typing import Literal

import numpy as np

from processing.geometry import PinholeCamera
from processing.synthetic.illumination import dust_transmittance, light_field
from processing.synthetic.liquid.nozzles import hollow_cone_spray
from processing.synthetic.rendering import render_transmittance
from processing.synthetic.sensor import Image, Sensor, camera_image
from processing.synthetic.shadow_cache import ShadowCache
from processing.synthetic.spray import Spray
from processing.synthetic.stamping import FloatImage
from processing.synthetic.target import Checkerboard, Target, render_target
from processing.synthetic.view_optics import ViewOptics

NOMINAL_LIGHT = 0.5
"""Part of the dynamic range that the nominal current fills within ``NOMINAL_WIDTH_NS`` (paper, set-up)."""
NOMINAL_WIDTH_NS = 1000
_KEPT_SPRAYS = 64

Pulse = tuple[int, int, float]
"""(start_ns, collected_ns, current_a): the part of a light pulse that an exposure collects."""
SprayFactory = Callable[[Sequence[int]], Spray]
"""From a seed to the liquid at time zero, the trigger of the shot."""


class SceneKind(StrEnum):
    """What the operator has prepared; the same words as a run's kind."""

    SAMPLE = "sample"
    BACKGROUND = "background"
    DARK = "dark"
    CALIBRATION = "calibration"


_KIND_SEEDS = {kind: number for number, kind in enumerate(SceneKind)}


class Scene:
    """A spray, a target and the light, seen by several views.

    Parameters
    ----------
    cameras : Mapping[str, PinholeCamera]
        Cameras by view.
    optics : Mapping[str, ViewOptics]
        Lens and light by view.
    seed : int
        Of spray, dust, light and noise.
    spray_factory : SprayFactory
        Called with [seed, sequence]: every firing sees its own realisation.
    target : Target, optional
        Stands in the volume while the scene is prepared for calibration; the paper's checkerboard by default.
    stage_z_mm : Callable[[], float]
        Position of the target, asked at every exposure.
    sensor : Sensor, optional
        The cameras' sensor.
    cache_mb : int
        Memory for rendered shadows; one view of one pulse takes 3.7 MiB at 1600 x 1200.
    """

    def __init__(
        self,
        cameras: Mapping[str, PinholeCamera],
        optics: Mapping[str, ViewOptics],
        *,
        seed: int = 0,
        spray_factory: SprayFactory = hollow_cone_spray,
        target: Target | None = None,
        stage_z_mm: Callable[[], float] = lambda: 0.0,
        sensor: Sensor | None = None,
        cache_mb: int = 512,
    ) -> None:
        if set(cameras) != set(optics):
            raise ValueError(f"cameras are of views {sorted(cameras)}, optics of {sorted(optics)}")
        self.cameras, self.optics = dict(cameras), dict(optics)
        self.target: Target = target or Checkerboard()
        self._seed, self._stage_z_mm, self._sensor = seed, stage_z_mm, sensor or Sensor()
        self._spray_at_trigger = lru_cache(maxsize=_KEPT_SPRAYS)(lambda sequence: spray_factory([seed, sequence]))
        self._kind = SceneKind.BACKGROUND
        self._shadows = ShadowCache(cache_mb * 2**20)
        self._view_seeds = {view: number for number, view in enumerate(cameras)}
        self._fields = {view: self._field(view) for view in cameras}

    def prepare(self, kind: str) -> None:
        """Play the operator before a run: "sample", "background", "dark" (no light) or "calibration"."""
        self._kind = SceneKind(kind)

    def render(
        self,
        view: str,
        sequence: int,
        frame: Literal["A", "B"],
        pulses: Sequence[Pulse],
        shape: tuple[int, int],
        bits: int,
    ) -> Image:
        """Image of one exposure.

        Parameters
        ----------
        view : str
            Which view.
        sequence : int
            Number of the firing.
        frame : {"A", "B"}
            B collects room light during its long exposure.
        pulses : sequence of (start_ns, collected_ns, current_a)
            Light that the exposure really collects, zero is the trigger of the shot; two pulses expose doubly.
        shape : tuple[int, int]
            (rows, columns), those of the view's camera.
        bits : int
            Significant bits of a grey value.

        Returns
        -------
        (row, column) uint8 array, uint16 from 9 bits on
            Grey values.
        """
        if shape != self._fields[view].shape:
            raise ValueError(f"{view}: the scene renders {self._fields[view].shape} (rows, columns), not {shape}")
        kind = self._kind
        light = np.full(shape, self._sensor.ambient_b if frame == "B" else 0, np.float32)
        for pulse in pulses if kind is not SceneKind.DARK else ():
            light += self._light(view, pulse) * self._shadow(kind, view, sequence, pulse)
        seeds = [self._seed, _KIND_SEEDS[kind], self._view_seeds[view], sequence, "AB".index(frame)]
        return camera_image(light, self._sensor, bits, np.random.Generator(np.random.SFC64(seeds)))

    def truth(self, sequence: int, time_ns: float) -> Spray:
        """The liquid of one firing at a time after its trigger."""
        return self._spray_at_trigger(sequence).advanced(time_ns * 1e-9)

    def _field(self, view: str) -> FloatImage:
        """Light of a view without spray at its nominal exposure."""
        width_px, height_px = self.cameras[view].image_size_px
        seeds = [self._seed, self._view_seeds[view]]
        shape = (height_px, width_px)
        return np.float32(NOMINAL_LIGHT) * light_field(shape, [*seeds, 0]) * dust_transmittance(shape, [*seeds, 1])

    def _light(self, view: str, pulse: Pulse) -> FloatImage:
        _, collected_ns, current_a = pulse
        relative = current_a / self.optics[view].nominal_current_a * collected_ns / NOMINAL_WIDTH_NS
        return np.float32(relative) * self._fields[view]

    def _shadow(self, kind: SceneKind, view: str, sequence: int, pulse: Pulse) -> FloatImage | float:
        """Transmittance of what stands before a view; 1 where nothing does."""
        camera, optics = self.cameras[view], self.optics[view]
        if kind is SceneKind.SAMPLE:
            start_ns, collected_ns, _ = pulse
            return self._shadows.get(
                (view, sequence, start_ns, collected_ns),
                lambda: render_transmittance(
                    camera, self.truth(sequence, start_ns + collected_ns / 2), optics, collected_ns * 1e-9
                ),
            )
        if kind is SceneKind.CALIBRATION:
            z_mm = round(self._stage_z_mm(), 4)
            return self._shadows.get((view, z_mm), lambda: render_target(camera, self.target, z_mm, optics))
        return 1.0
