"""Whether droplets have company that no chance gives: streaks and saturated spots are explained by several droplets.

Shadows that are longer than wide are, too: by two discs that reach into each other, which droplets in space never do.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from processing.analysis.droplets.droplet_table import Droplets, SizedDroplets
from processing.analysis.droplets.measured_exposure import MeasuredExposure, Seen
from processing.geometry import FloatArray
from processing.volume import VoxelGrid

NEAR_VOXEL = 4.0
"""Droplets that are closer have company: what moves while the light is on leaves them one to three voxels apart."""
MOST_COMPANY = 1 / 8
"""Share of the droplets that may have company beyond chance: 0 to 0.04 in simulated shots of 14 to 56 per mm^3, 0.25 to
0.95 of streaks of three pixels or more and of spots that are saturated at half of their height."""
LEAST_DROPLETS = 10
"""That tell a share."""
REACHING, LEAST_ALIKE = 0.9, 0.6
"""Droplets reach into each other that are closer than so many sums of their radii, if the smaller one is so many times
as large as the larger: two halves of an oval are about as large, what is left beside a droplet is smaller."""
FEWEST_PAIRS, MOST_REACHING = 2, 0.1
"""That tell anything, and share of the volume of all droplets. Where large ones were 25 to 43 % longer than wide it
was 14 to 70 %, and D32 up to 27 % too small; 13 of 2400 clouds that were placed at random have it."""


def judged_by_company(shot: MeasuredExposure[Droplets, Seen], grid: VoxelGrid) -> MeasuredExposure[Droplets, Seen]:
    """A shot, doubtful where many of its droplets have company that chance does not give."""
    points_mm = shot.droplets.points_mm
    if len(points_mm) < LEAST_DROPLETS:
        return shot
    near_mm = NEAR_VOXEL * grid.pitch_mm
    nearest_mm = np.asarray(cKDTree(points_mm).query(points_mm, k=2)[0])[:, 1]
    chance = -np.expm1(-len(points_mm) * 4 / 3 * np.pi * near_mm**3 / grid.volume_mm3)
    company = float(np.mean(nearest_mm < near_mm) - chance)
    if company <= MOST_COMPANY:
        return shot
    reason = (
        f"{100 * company:.0f} % of the droplets have another one within {NEAR_VOXEL:g} voxels beyond chance, limit "
        f"{100 * MOST_COMPANY:.0f} %: do they move while the light is on, are they saturated, or wider than spots? "
        "Their number is wrong then"
    )
    return shot.doubted((reason,))


def judged_by_overlap(shot: MeasuredExposure[SizedDroplets, Seen]) -> MeasuredExposure[SizedDroplets, Seen]:
    """A shot, doubtful where much of its liquid is in droplets that reach into another one."""
    diameters_um = shot.droplets.diameters_um
    pairs = _reaching(shot.droplets.points_mm, 0.5e-3 * diameters_um)
    if len(pairs) < FEWEST_PAIRS:
        return shot
    share = float(np.sum(diameters_um[np.unique(pairs)] ** 3) / np.sum(diameters_um**3))
    if share <= MOST_REACHING:
        return shot
    reason = (
        f"{len(pairs)} pairs of droplets, with {100 * share:.0f} % of the volume, limit {100 * MOST_REACHING:.0f} %, "
        "reach into each other: are large ones flattened, or longer than wide? Each is told as two then, their number "
        "is too large, and D32 too small"
    )
    return shot.doubted((reason,))


def _reaching(points_mm: FloatArray, radii_mm: FloatArray) -> NDArray[np.intp]:
    """Pairs (M, 2) of droplets about as large as each other that reach into each other."""
    if len(radii_mm) < FEWEST_PAIRS:
        return np.empty((0, 2), np.intp)
    pairs = cKDTree(points_mm).query_pairs(2 * REACHING * float(radii_mm.max()), output_type="ndarray")
    apart_mm = np.linalg.norm(points_mm[pairs[:, 0]] - points_mm[pairs[:, 1]], axis=1)
    both_mm = radii_mm[pairs]
    reaching = apart_mm < REACHING * both_mm.sum(axis=1)
    alike = both_mm.min(axis=1) >= LEAST_ALIKE * both_mm.max(axis=1)
    return np.asarray(pairs[reaching & alike], np.intp)
