"""Whether droplets have company that no chance gives: streaks and saturated spots are explained by several droplets."""

import numpy as np
from scipy.spatial import cKDTree

from processing.analysis.droplets.droplet_table import Droplets
from processing.analysis.droplets.measured_exposure import MeasuredExposure, Seen
from processing.volume import VoxelGrid

NEAR_VOXEL = 4.0
"""Droplets that are closer have company: what moves while the light is on leaves them one to three voxels apart."""
MOST_COMPANY = 1 / 8
"""Share of the droplets that may have company beyond chance: 0 to 0.04 in simulated shots of 14 to 56 per mm^3, 0.25 to
0.95 of streaks of three pixels or more and of spots that are saturated at half of their height."""
LEAST_DROPLETS = 10
"""That tell a share."""


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
