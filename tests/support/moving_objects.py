"""Threads, discs and droplets that move from one exposure to the other, as the paper's four views see them."""

from dataclasses import dataclass

import numpy as np

from processing.geometry import FloatArray, PinholeCamera
from processing.preprocessing import Intensity
from processing.studies.simulated_droplets import study_cameras
from processing.synthetic.paper_rig import paper_optics
from processing.synthetic.rendering import render_transmittance
from processing.synthetic.shadow_shots import Counting
from processing.synthetic.spray import Spray

IMAGE_SIZE_PX = (420, 300)
PITCH_MM = 1 / 60
NOISE = 0.012


@dataclass(frozen=True, eq=False)
class Body:
    """Balls (N, 3) of one radius, in mm, and where they go, in mm."""

    balls_mm: FloatArray
    radius_mm: float
    moved_mm: FloatArray


@dataclass(frozen=True, eq=False)
class TwoExposures:
    """What the views see before and after."""

    before: list[Intensity]
    after: list[Intensity]
    cameras: list[PinholeCamera]


def thread(middle_mm: FloatArray, direction: FloatArray, length_mm: float, moved_mm: FloatArray) -> Body:
    """A thread of 0.07 mm."""
    along_mm = np.arange(-length_mm / 2, length_mm / 2, 0.02)
    return Body(middle_mm + along_mm[:, None] * direction / np.linalg.norm(direction), 0.035, moved_mm)


def exposures(bodies: list[Body], rng: np.random.Generator) -> TwoExposures:
    """Images of both exposures, with noise."""
    cameras = study_cameras(IMAGE_SIZE_PX)
    diameters_mm = np.concatenate([np.full(len(body.balls_mm), 2 * body.radius_mm) for body in bodies])
    seen = []
    for share in (0, 1):
        places_mm = np.concatenate([body.balls_mm + share * body.moved_mm for body in bodies])
        spray = Spray.of_droplets(places_mm, diameters_mm)
        seen.append(
            [
                Counting.of_noise(NOISE).transmission(render_transmittance(camera, spray, view), rng)
                for camera, view in zip(cameras, paper_optics().values(), strict=True)
            ]
        )
    return TwoExposures(seen[0], seen[1], cameras)


def hull_of_body(body: Body) -> FloatArray:
    """Points (M, 3) in mm all over a body, about as wide as it is: stands for the voxels of its hull."""
    around = PITCH_MM * np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)])
    return np.asarray((body.balls_mm[:, None] + around).reshape(-1, 3))
