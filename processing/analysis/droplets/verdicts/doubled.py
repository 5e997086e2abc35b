"""Whether droplets are there twice: two flashes in one exposure, or a reflection in a window."""

import numpy as np
from numpy.typing import NDArray

from processing.analysis.common_way import LEAST, common_way, ways_between
from processing.analysis.droplets.droplet_table import DropletRows
from processing.analysis.droplets.measured_exposure import MeasuredExposure, Rows, Seen
from processing.geometry import FloatArray
from processing.volume import VoxelGrid

MOST_DROPLETS = 400
"""That are asked, those nearest to the middle: they are enough to tell."""
LOOKS = ((4.0, 0.0, LEAST), (8.0, 12.0, 2 * LEAST))
"""How much ways of droplets that fly together differ, in voxels; how long such ways are at least; and how many must
agree: in a cone, or a spray that scatters, they differ by more, and so do those of rows and clusters, which are
short, or few."""
SHARE = 0.25
"""Of the droplets that have a copy; where all are there twice it is a half, less those that leave the box."""
FAINT_SHARE, FAINTER, ONE_WAY = 0.08, 1.3, 0.9
"""A weak flash shows copies of large droplets alone, all of them smaller or fainter than what they are copies of: so
few are enough, if so large a share of them is by so many times, in the same direction."""
NEARBY, CHANCES = 2, 2
"""So many spreads around a way others tell what it has by chance; so many times that does not count: clusters have more
in their middle."""
ONWARDS = np.array([0.6, 0.8, 0.3])
"""Ways are counted in this direction: no axis is across it."""


def judged_by_copies(shot: MeasuredExposure[Rows, Seen], grid: VoxelGrid) -> MeasuredExposure[Rows, Seen]:
    """A shot, doubtful where droplets are there again, all of them as far away."""
    told = (_copies(shot.droplets, grid.pitch_mm, *look) for look in LOOKS)
    reason = next(filter(None, told), "")
    return shot.doubted((reason,)) if reason else shot


def _copies(droplets: DropletRows, pitch_mm: float, spread: float, shortest: float, least: int) -> str:
    """What is wrong where so many have a copy, as far away but for a spread in voxels; empty where they have none."""
    asked = _asked(droplets.points_mm)
    asked_mm = droplets.points_mm[asked]
    ways_mm, spread_mm = ways_between(asked_mm, ONWARDS), spread * pitch_mm
    way_mm, count = common_way(ways_mm, spread_mm)
    near = np.linalg.norm(ways_mm - way_mm, axis=1) <= spread_mm
    share = FAINT_SHARE if _fainter(asked_mm, _heights(droplets)[asked], near) else SHARE
    beyond_chance = count - CHANCES * _by_chance(ways_mm - way_mm, spread_mm)
    if np.linalg.norm(way_mm) < shortest * pitch_mm or beyond_chance < max(least, share * len(asked)):
        return ""
    way = ", ".join(f"{along_mm:.2f}" for along_mm in way_mm)
    return (
        f"{count} of {len(asked)} droplets are there again {way} mm away (x, y, z): is the light on twice within an "
        "exposure, are A and B in one image, or do they reflect in a window? They count twice then"
    )


def _asked(points_mm: FloatArray) -> NDArray[np.intp]:
    """The droplets nearest to the middle."""
    if not len(points_mm):
        return np.empty(0, np.intp)
    return np.argsort(np.linalg.norm(points_mm - np.median(points_mm, axis=0), axis=1))[:MOST_DROPLETS]


def _by_chance(beside_mm: FloatArray, spread_mm: float) -> float:
    """How many ways (N, 3) are one as ways nearby are: droplets that lie in clusters have many, and no copies."""
    beside = np.linalg.norm(beside_mm, axis=1) / spread_mm
    return float(np.count_nonzero((beside > 1) & (beside <= NEARBY)) / (NEARBY**3 - 1))


def _heights(droplets: DropletRows) -> FloatArray:
    """How large droplets are (N,), or else how bright."""
    return np.asarray(droplets.columns()["diameter_um" if droplets.sized else "amplitude"], np.float64)


def _fainter(places_mm: FloatArray, heights: FloatArray, near: NDArray[np.bool_]) -> bool:
    """Whether the near ones of all ways lead from larger to smaller droplets, or all of them back."""
    one, other = np.triu_indices(len(places_mm), 1)
    back = (places_mm[other] - places_mm[one]) @ ONWARDS < 0
    growths = (np.log(heights[other] / heights[one]) * np.where(back, -1, 1))[near]
    smaller, larger = (np.count_nonzero(sign * growths > np.log(FAINTER)) for sign in (-1, 1))
    return bool(max(smaller, larger) >= ONE_WAY * max(len(growths), 1))
