"""Shots that are simulated and measured, and which of their droplets are real."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.bright_shot import BrightExposure
from processing.analysis.droplets.droplet_search import plan_droplets
from processing.analysis.droplets.ghost_share import RADIUS_VOXEL, matches
from processing.analysis.droplets.shadows.shadow_shot import ShadowExposure
from processing.geometry import FloatArray
from processing.kernels import DEFAULT_THREADS
from processing.studies.droplets import IMAGE_SIZE_PX, DropletCase, bright_scene
from processing.studies.shadows.sizes import SizeCase, size_scene
from processing.studies.simulated_droplets import study_grid
from processing.studies.velocity.measured_case import measured_case

SLAB = (250, 60, 500)
"""The full depth and width of the paper's volume."""


@dataclass(frozen=True, eq=False)
class JudgedShot:
    """A shot that was measured, and judged by its truth.

    Parameters
    ----------
    kind : str
        ``bright`` or ``shadows``.
    residual_over_noise : float
        Of the shot.
    verdict : str
        On it.
    p_real : (N,) array
        What is told of each droplet.
    real : (N,) bool array
        Whether it is.
    """

    kind: str
    residual_over_noise: float
    verdict: str
    p_real: FloatArray
    real: NDArray[np.bool_]


def judged_shot(
    case: DropletCase | SizeCase, seed: int, shape: tuple[int, int, int] = SLAB, threads: int = DEFAULT_THREADS
) -> JudgedShot:
    """Simulate a shot of a case, measure it, and say which droplets are real."""
    grid, rng = study_grid(shape), np.random.default_rng(seed)
    radius_mm = RADIUS_VOXEL * grid.pitch_mm
    if isinstance(case, DropletCase):
        bright = bright_scene(case, grid, IMAGE_SIZE_PX, rng)
        found = measured_case(case, bright.images, plan_droplets(bright.believed, grid), threads)
        return _judged("bright", found, matches(found.droplets.points_mm, bright.points_mm, radius_mm)[0])
    dark = size_scene(case, grid, IMAGE_SIZE_PX, rng)
    sized = measured_case(case, dark.images, plan_droplets(dark.believed, grid), threads, "gaussian")
    return _judged("shadows", sized, matches(sized.droplets.points_mm, dark.spray.positions_mm, radius_mm)[0])


def _judged(kind: str, shot: BrightExposure | ShadowExposure, match: FloatArray) -> JudgedShot:
    return JudgedShot(kind, shot.residual_over_noise or 0.0, shot.verdict.value, shot.droplets.p_real, match >= 0)
