"""Visual hulls of simple bodies, as distant views see them: voxels whose lines of sight all meet the body."""

import numpy as np
from scipy.spatial import cKDTree

from processing.analysis.objects.dark_voxels import FULL, DarkVoxels
from processing.geometry import FloatArray
from processing.volume import VoxelGrid

AZIMUTHS_DEG = (45.0, 15.0, -15.0, -45.0)


def distant_views(azimuths_deg: tuple[float, ...] = AZIMUTHS_DEG) -> FloatArray:
    """How views around y see motions: (views, 2, 3)."""
    angles = np.deg2rad(azimuths_deg)
    return np.array([[[np.cos(a), 0, np.sin(a)], [0, 1, 0]] for a in angles])


def hull_of(balls_mm: FloatArray, radius_mm: float, sight: FloatArray, grid: VoxelGrid) -> DarkVoxels:
    """Hull of the union of equal balls (N, 3); each view sees their discs."""
    z, y, x = np.meshgrid(grid.z_mm, grid.y_mm, grid.x_mm, indexing="ij")
    points_mm = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    dark = np.ones(len(points_mm), bool)
    for view in sight:
        dark[dark] = cKDTree(balls_mm @ view.T).query(points_mm[dark] @ view.T)[0] <= radius_mm
    numbers = np.flatnonzero(dark)
    return DarkVoxels(grid, numbers, np.full(len(numbers), FULL, np.uint8))
