"""The motion at a place, from droplets around it whose motion is known: a local linear fit."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from processing.geometry import FloatArray

NEIGHBOURS = 30
OUTLIER = 4.0
"""Neighbours whose displacement is so many times the median distance from the median are not asked."""
OUTLIER_FLOOR_VOXEL = 0.5


@dataclass(frozen=True, eq=False)
class KnownMotion:
    """Displacements that are known.

    Parameters
    ----------
    places, shifts : (M, 3) arrays
        Where, and the displacement from A to B, in voxels.
    weights : (M,) array
        How sure each is, 0 to 1.
    owners : (M,) int array
        Droplet of A whose displacement it is; -1 where it is that of many.
    """

    places: FloatArray
    shifts: FloatArray
    weights: FloatArray
    owners: NDArray[np.intp]


def predicted(known: KnownMotion, places: FloatArray) -> FloatArray:
    """Displacement (N, 3) at places (N, 3), voxel.

    What is known of a droplet itself, the n-th place being that of droplet n, has no say: a wrong pair cannot confirm
    itself. Weights fall with the distance to the last neighbour (tricube). A gradient is believed as if one neighbour
    more said that there is none.
    """
    count = min(NEIGHBOURS + 1, len(known.places))
    distances, near = cKDTree(known.places).query(places, k=range(1, count + 1))
    distances = np.asarray(distances)
    farthest = distances[:, -1:] * 1.01 + 1e-9
    weights = (1 - (distances / farthest) ** 3) ** 3 * known.weights[near]
    weights *= known.owners[near] != np.arange(len(places))[:, None]
    shifts = known.shifts[near]
    weights *= _agreeing(shifts)
    return _linear_fit(known.places[near] - places[:, None], shifts, weights)


def _agreeing(shifts: FloatArray) -> NDArray[np.bool_]:
    """Which neighbours (N, k) do not stand apart from the median of their displacements (N, k, 3)."""
    apart = np.linalg.norm(shifts - np.median(shifts, axis=1, keepdims=True), axis=2)
    return np.asarray(apart < OUTLIER * np.median(apart, axis=1, keepdims=True) + OUTLIER_FLOOR_VOXEL)


def _linear_fit(offsets: FloatArray, shifts: FloatArray, weights: FloatArray) -> FloatArray:
    """Values at offset 0 of weighted linear fits, (N, 3)."""
    total = weights.sum(axis=1) + 1e-12
    basis = np.concatenate([np.ones((*weights.shape, 1)), offsets], axis=2)
    normal = np.einsum("nk,nki,nkj->nij", weights, basis, basis)
    ridge = np.trace(normal[:, 1:, 1:], axis1=1, axis2=2) / 3 / total + 1e-9
    normal[:, range(1, 4), range(1, 4)] += ridge[:, None]
    normal[:, 0, 0] += 1e-12
    right = np.einsum("nk,nki,nkj->nij", weights, basis, shifts)
    fit: FloatArray = np.linalg.solve(normal, right)
    return fit[:, 0]
