"""GhostShare: which part of what was found is no droplet, counted where the truth is known."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import betaincinv

from processing.analysis.estimates import CONFIDENCE
from processing.geometry import FloatArray

RADIUS_VOXEL = 1.0
"""How far a droplet may be found from where it is."""


@dataclass(frozen=True)
class GhostShare:
    """Ghosts among found droplets.

    Parameters
    ----------
    ghosts, found : int
        Of so many found droplets so many were ghosts.
    """

    ghosts: int
    found: int

    @property
    def share(self) -> float | None:
        """Ghosts over found; None where nothing was found."""
        return self.ghosts / self.found if self.found else None

    @property
    def interval(self) -> tuple[float, float] | None:
        """Where the share lies with 95 % confidence, by counting alone (Clopper and Pearson)."""
        return share_interval(self.ghosts, self.found) if self.found else None


def share_interval(chosen: int, of: int) -> tuple[float, float]:
    """Where a share lies with 95 % confidence, by counting alone (Clopper and Pearson)."""
    tail = (1 - CONFIDENCE) / 2
    low = betaincinv(chosen, of - chosen + 1, tail) if chosen else 0.0
    high = betaincinv(chosen + 1, of - chosen, 1 - tail) if chosen < of else 1.0
    return float(low), float(high)


def pooled(shares: Iterable[GhostShare]) -> GhostShare:
    """Counts of many together."""
    counted = list(shares)
    return GhostShare(sum(share.ghosts for share in counted), sum(share.found for share in counted))


def matches(found: FloatArray, truth: FloatArray, radius: float = RADIUS_VOXEL) -> tuple[FloatArray, FloatArray]:
    """Pairs of found and true positions one to one, closest first.

    Parameters
    ----------
    found : (N, 3) array
        Found positions.
    truth : (M, 3) array
        True ones.
    radius : float
        How far they may be apart.

    Returns
    -------
    (N,) int array
        Index of the true one, -1 for a ghost.
    (M,) int array
        Index of the found one, -1 where it was missed.
    """
    of_found, of_truth = np.full(len(found), -1), np.full(len(truth), -1)
    if not len(found) or not len(truth):
        return of_found, of_truth
    near = cKDTree(found).sparse_distance_matrix(cKDTree(truth), radius, output_type="coo_matrix")
    for pair in np.argsort(near.data, kind="stable"):
        one, other = int(near.row[pair]), int(near.col[pair])
        if of_found[one] < 0 and of_truth[other] < 0:
            of_found[one], of_truth[other] = other, one
    return of_found, of_truth
