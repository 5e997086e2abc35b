"""Whether droplets are there twice: two flashes in one exposure, or a reflection in a window."""

import numpy as np

from processing.analysis.common_way import LEAST, common_way, ways_between
from processing.analysis.droplets.measured_exposure import MeasuredExposure, Rows, Seen
from processing.geometry import FloatArray
from processing.volume import VoxelGrid

MOST_DROPLETS = 400
"""That are asked, those nearest to the middle: they are enough to tell."""
SPREAD_VOXEL = 4.0
"""Droplets that fly together differ by no more."""
SHARE = 0.25
"""Of the droplets that have a copy; where all are there twice it is a half, less those that leave the box."""
NEARBY, CHANCES = 2, 2
"""So many spreads around a way others tell what it has by chance; so many times that does not count: clusters have more
in their middle."""
ONWARDS = np.array([0.6, 0.8, 0.3])
"""Ways are counted in this direction: no axis is across it."""


def judged_by_copies(shot: MeasuredExposure[Rows, Seen], grid: VoxelGrid) -> MeasuredExposure[Rows, Seen]:
    """A shot, doubtful where droplets are there again, all of them as far away."""
    points_mm = shot.droplets.points_mm
    from_middle_mm = np.linalg.norm(points_mm - np.median(points_mm, axis=0), axis=1) if len(points_mm) else []
    asked_mm = points_mm[np.argsort(from_middle_mm)[:MOST_DROPLETS]]
    ways_mm, spread_mm = ways_between(asked_mm, ONWARDS), SPREAD_VOXEL * grid.pitch_mm
    way_mm, count = common_way(ways_mm, spread_mm)
    if count - CHANCES * _by_chance(ways_mm - way_mm, spread_mm) < max(LEAST, SHARE * len(asked_mm)):
        return shot
    way = ", ".join(f"{along_mm:.2f}" for along_mm in way_mm)
    reason = (
        f"{count} of {len(asked_mm)} droplets are there again {way} mm away (x, y, z): is the light on twice within an "
        "exposure, are A and B in one image, or do they reflect in a window? They count twice then"
    )
    return shot.doubted((reason,))


def _by_chance(beside_mm: FloatArray, spread_mm: float) -> float:
    """How many ways (N, 3) are one as ways nearby are: droplets that lie in clusters have many, and no copies."""
    beside = np.linalg.norm(beside_mm, axis=1) / spread_mm
    return float(np.count_nonzero((beside > 1) & (beside <= NEARBY)) / (NEARBY**3 - 1))
