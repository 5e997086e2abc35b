"""The visual hull of one exposure: voxels that all views see dark, and of which enough views know something."""

from collections.abc import Sequence

import cv2
import numpy as np

from processing.analysis.objects.break_up import THRESHOLDS
from processing.analysis.objects.dark_voxels import DarkVoxels, dark_voxels
from processing.analysis.objects.seeing_views import pixels_of
from processing.geometry import ViewMapping
from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.line_of_sight import slabs_of_sight
from processing.reconstruction.planning.plan import Plan
from processing.reconstruction.slab_volume import SLAB_ROWS

LEAST_KNOWING = 2
"""So many views must know something of a place that is dark."""


def darkness_of(images: Sequence[Intensity], trust: Sequence[Intensity] | None) -> list[Intensity]:
    """Share of the light that is missing; all of it where nothing is known."""
    darkness = [np.clip(1 - image, 0, 1) for image in images]
    if trust is None:
        return darkness
    return [np.where(sure > 0, dark, np.float32(1)) for dark, sure in zip(darkness, trust, strict=True)]


def hull_of(darkness: Sequence[Intensity], plan: Plan, threads: int = DEFAULT_THREADS) -> DarkVoxels:
    """Voxels that all views see dark, by the lowest of the thresholds.

    Raises
    ------
    ValueError
        There are too many of them.
    """
    grid = plan.grid
    slab = np.empty((grid.shape[0], min(SLAB_ROWS, grid.shape[1]), grid.shape[2]), np.uint8)
    slabs = slabs_of_sight(plan, darkness, ReconstructionMethod.MINLOS, out=slab, threads=threads)
    return dark_voxels(slabs, grid, min(THRESHOLDS))


def known(voxels: DarkVoxels, trust: Sequence[Intensity] | None, mappings: Sequence[ViewMapping]) -> DarkVoxels:
    """Those of which enough views know something: a pixel and its neighbours, which samples mix."""
    if trust is None or all((sure > 0).all() for sure in trust):
        return voxels
    points_mm = voxels.points_mm
    pixels = [pixels_of(mapping, points_mm).T for mapping in mappings]
    sures = [cv2.erode((sure > 0).astype(np.uint8), np.ones((5, 5), np.uint8)) for sure in trust]
    knowing = np.sum([sure[rows, columns] for sure, (columns, rows) in zip(sures, pixels, strict=True)], axis=0)
    return voxels.where(knowing >= LEAST_KNOWING)
