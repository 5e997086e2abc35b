"""Discs that are one droplet found twice."""

import numpy as np

from processing.analysis.droplets.candidates import close_pairs
from processing.analysis.droplets.shadows.discs.opaque_discs import Discs

SAME_VOXEL, SAME_RADII = 1.0, 0.6
"""A droplet that is closer to a larger one, or by so many radii of it, is the same."""
SMALL_VOXEL2 = 2.0
"""Squared radius below which a droplet takes over half of what was the same."""


def merged_discs(discs: Discs) -> Discs:
    """Of discs whose centres are the same, or well within a larger one, the larger alone."""
    order = np.argsort(-discs.squares_voxel2, kind="stable")
    positions, squares = discs.positions_voxel[order], discs.squares_voxel2[order]
    if not len(order):
        return discs
    apart, kept = np.maximum(SAME_VOXEL, SAME_RADII * np.sqrt(squares)), np.ones(len(order), bool)
    for one, other in close_pairs(positions, float(apart[0])):
        if kept[one] and kept[other] and np.linalg.norm(positions[one] - positions[other]) < apart[one]:
            kept[other] = False
            squares[one] += 0.5 * squares[other] if squares[one] < SMALL_VOXEL2 else 0.0
    return Discs(positions[kept], squares[kept])
