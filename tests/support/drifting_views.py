"""Shots of droplets seen by the four views of the paper, one of which has moved since it was calibrated."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from processing.calibration.calibration import Calibration, Model
from processing.geometry import FloatArray, PinholeCamera, ViewMapping
from processing.runs.shots.shot_check import Exposure, ShotCheck, check_shots
from processing.studies.seen_droplets import droplet_calibration, droplet_views, seen_droplets
from processing.studies.simulated_droplets import AZIMUTHS_DEG

HALF_MM = np.array([2.5, 2.0, 1.5])
SIZE_PX = (400, 300)
DENSITY_PER_MM3 = 7.0


def views(azimuths_deg: Sequence[float] = AZIMUTHS_DEG) -> list[PinholeCamera]:
    """Cameras at 60 px/mm, slightly distorted."""
    return droplet_views(SIZE_PX, azimuths_deg)


@lru_cache(maxsize=4)
def droplet_shots(
    count: int, density_per_mm3: float = DENSITY_PER_MM3, azimuths_deg: tuple[float, ...] = AZIMUTHS_DEG
) -> tuple[tuple[FloatArray, ...], ...]:
    """Detected droplets by shot and view."""
    rng = np.random.default_rng(7)
    return tuple(seen_droplets(views(azimuths_deg), HALF_MM, density_per_mm3, rng) for _ in range(count))


def calibration_of(mappings: Sequence[ViewMapping], model: Model = Model.PINHOLE) -> Calibration:
    """A calibration of the measured volume with these mappings."""
    return droplet_calibration(mappings, HALF_MM, model)


def inside_mm(count: int = 300) -> FloatArray:
    """Points all over the measured volume."""
    return np.random.default_rng(3).uniform(-HALF_MM, HALF_MM, (count, 3))


def check_one(exposures: Sequence[Exposure], calibration: Calibration) -> ShotCheck:
    """What a shot by itself says."""
    (check,) = check_shots({0: exposures}, calibration)
    return check
