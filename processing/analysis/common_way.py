"""The way that most pairs of droplets have in common: where they are there twice, each is as far from its copy."""

import numpy as np
from scipy.spatial import cKDTree

from processing.geometry import FloatArray

LEAST = 6
"""Pairs that can agree."""
UNIQUE = 0.5
"""Of the best agreement that any other may have: dots of a lattice agree in many ways."""


def common_way(ways: FloatArray, spread: float) -> tuple[FloatArray, int]:
    """The way that most have in common, and how many; 0 if other ways do nearly as well.

    Parameters
    ----------
    ways : (N, D) array
        From one droplet to another, in any unit.
    spread : float
        In the same unit: ways that are one differ by no more.
    """
    nobody = np.zeros(ways.shape[1]), 0
    if len(ways) < LEAST:
        return nobody
    counts = np.asarray(cKDTree(ways).query_ball_point(ways, spread, return_length=True))
    best = int(counts.argmax())
    beside = np.linalg.norm(ways - ways[best], axis=1)
    if np.max(counts[beside > 3 * spread], initial=0) > UNIQUE * counts[best]:
        return nobody
    near = beside <= spread
    return np.median(ways[near], axis=0), int(near.sum())


def ways_between(places: FloatArray, onwards: FloatArray) -> FloatArray:
    """Ways (N (N - 1) / 2, D) from each of N places (N, D) to each other one, all of them in about one direction (D,).

    The order is that of ``numpy.triu_indices``.
    """
    one, other = np.triu_indices(len(places), 1)
    ways = places[other] - places[one]
    return np.asarray(np.where((ways @ onwards < 0)[:, None], -ways, ways))
