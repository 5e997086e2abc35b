"""Shots of shadows for studies: what views see of a spray, divided by their light, with the noise of counting."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from processing.geometry import PinholeCamera
from processing.synthetic.rendering import render_transmittance
from processing.synthetic.spray import Spray
from processing.synthetic.stamping import FloatImage
from processing.synthetic.union import ACCURATE
from processing.synthetic.view_optics import ViewOptics


@dataclass(frozen=True)
class Counting:
    """A sensor that counts electrons, and the background that its images are divided by.

    Parameters
    ----------
    background_e : float
        Electrons of a pixel where nothing stands in the light.
    read_noise_e : float
        Standard deviation of the read-out.
    background_frames : int, optional
        The background is the mean of so many frames, with their noise; without, it is known exactly.
    """

    background_e: float = 7400.0
    read_noise_e: float = 25.0
    background_frames: int | None = None

    @classmethod
    def of_noise(cls, relative: float, background_frames: int | None = None) -> "Counting":
        """Shot noise alone, a share ``relative`` of the background where nothing stands in the light."""
        return cls(relative**-2, 0.0, background_frames)

    def transmission(self, transmittance: FloatImage, rng: np.random.Generator) -> FloatImage:
        """A transmittance as it is measured, float32; noise goes below 0 and above 1."""
        counts = self._counts(transmittance, rng)
        if self.background_frames is None:
            return np.asarray(counts / self.background_e, dtype=np.float32)
        light = np.ones(transmittance.shape, np.float32)
        background = sum(self._counts(light, rng) for _ in range(self.background_frames)) / self.background_frames
        return np.asarray(counts / background, dtype=np.float32)

    def _counts(self, transmittance: FloatImage, rng: np.random.Generator) -> FloatImage:
        electrons = rng.poisson(self.background_e * np.clip(transmittance, 0, None).astype(np.float64))
        return np.asarray(electrons + rng.normal(0, self.read_noise_e, transmittance.shape), dtype=np.float64)


def transmission_images(
    cameras: Sequence[PinholeCamera],
    optics: Sequence[ViewOptics],
    spray: Spray,
    counting: Counting,
    rng: np.random.Generator,
    exposure_s: float = 0.0,
) -> list[FloatImage]:
    """What several views see of a spray in the middle of an exposure, divided by their backgrounds.

    Drawn with rays that meet all droplets (``union.ACCURATE``). The liquid may lie outside of what is measured:
    whatever a view sees of it darkens its image.

    Parameters
    ----------
    cameras, optics : sequences of PinholeCamera and ViewOptics
        One of each per view.
    spray : Spray
        Droplets and other liquid (``liquid.droplet_clouds``, ``liquid.threads_and_films``); ``spray.advanced(dt_s)``
        is the same liquid in a second exposure.
    counting : Counting
        Noise and background.
    rng : numpy Generator
        Source of the noise, view by view.
    exposure_s : float
        Duration of the light pulse.

    Returns
    -------
    list of (row, column) float32 arrays
        One per view.
    """
    return [
        counting.transmission(render_transmittance(camera, spray, view, exposure_s, ACCURATE), rng)
        for camera, view in zip(cameras, optics, strict=True)
    ]
