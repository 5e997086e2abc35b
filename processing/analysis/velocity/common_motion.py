"""Where most droplets of a neighbourhood went: the commonest displacement among all pairs of a sub-volume.

A sub-volume is a droplet of A and its nearest neighbours, so that it is small where droplets are dense. Displacements
of all pairs (A, B) within reach are points in a space of their own; the true pairs are a heap there, the wrong ones a
fog. A heap is believed only if fog alone, as dense as it is around the heap, would hardly ever make one, and if no
other heap is nearly as large. No motion need be guessed, and nothing depends on bins.

Where all pairs make no such heap, those of droplets that are as large as each other may: there are fewer wrong ones.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.special import gammainc

from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.geometry import FloatArray

REACH_VOXEL = 25.0
"""The largest displacement that is looked for."""
ALIKE = 0.1
"""Of the natural logarithm of size: within it two droplets may be one."""
LOOKS = ((2.5, np.inf), (2.5, ALIKE), (5.0, ALIKE))
"""Radius of a heap in voxels, for scatter and gradients across a sub-volume, and by how much sizes of its pairs may
differ: the first look that shows a heap is believed."""
NEIGHBOURS, STRIDE = 60, 15
"""Droplets of a sub-volume; of so many droplets one is in the middle of a sub-volume."""
FEWEST = 3
"""Pairs of a heap."""
CHANCE = 1e-4
"""Heaps that fog makes more often are not believed."""
RIVAL = 0.75
"""A second heap that is larger by comparison leaves it open which is right, as in a row of evenly spaced droplets."""
MEAN_SHIFTS = 4
Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class CommonMotion:
    """Displacements that most droplets of a sub-volume share.

    Parameters
    ----------
    places : (M, 3) array
        Middles of the droplets that share it, in voxels.
    shifts : (M, 3) array
        Displacements from A to B, in voxels.
    """

    places: FloatArray
    shifts: FloatArray

    def __len__(self) -> int:
        return len(self.places)


def common_motion(first: MovingDroplets, second: MovingDroplets) -> CommonMotion:
    """The commonest displacement of every sub-volume that has one.

    Parameters
    ----------
    first, second : MovingDroplets
        Of A and of B.
    """
    if not len(first) or not len(second):
        return CommonMotion(np.empty((0, 3)), np.empty((0, 3)))
    own, other = _within_reach(first.places, second.places)
    places, displacements = first.places[own], second.places[other] - first.places[own]
    unlike = np.abs(second.log_sizes[other] - first.log_sizes[own])
    ends = np.searchsorted(own, np.arange(len(first) + 1))
    heaps = []
    for window in _windows(first.places):
        chosen = np.concatenate([np.arange(ends[one], ends[one + 1]) for one in window])
        looks = ((chosen[unlike[chosen] < most], radius) for radius, most in LOOKS)
        found = (_heap(places[some], displacements[some], radius) for some, radius in looks)
        if (heap := next((one for one in found if one is not None), None)) is not None:
            heaps.append(heap)
    middles, shifts = zip(*heaps, strict=True) if heaps else ((), ())
    return CommonMotion(np.reshape(middles, (-1, 3)), np.reshape(shifts, (-1, 3)))


def _windows(first: FloatArray) -> Indices:
    """Indices (W, k) of the droplets of sub-volumes, which overlap; the middle ones do not depend on the order."""
    middles = first[np.lexsort(first.T)][::STRIDE]
    _, windows = cKDTree(first).query(middles, k=range(1, min(NEIGHBOURS, len(first)) + 1))
    return np.asarray(windows, np.intp)


def _within_reach(first: FloatArray, second: FloatArray) -> tuple[Indices, Indices]:
    """Indices of A and of B of all pairs within reach, by A."""
    near = cKDTree(first).sparse_distance_matrix(cKDTree(second), REACH_VOXEL, output_type="coo_matrix")
    order = np.lexsort((near.col, near.row))
    return near.row[order].astype(np.intp), near.col[order].astype(np.intp)


def _heap(places: FloatArray, displacements: FloatArray, radius: float) -> tuple[FloatArray, FloatArray] | None:
    """Middle and displacement of the largest heap of pairs that begin at places; None where fog might be all."""
    if len(places) < FEWEST:
        return None
    tree = cKDTree(displacements)
    counts = np.asarray(tree.query_ball_point(displacements, radius, return_length=True))
    top = displacements[np.argmax(counts)]
    rivals = counts[np.linalg.norm(displacements - top, axis=1) > 2 * radius]
    if counts.max() < FEWEST or rivals.max(initial=0) > RIVAL * counts.max():
        return None
    if not _is_believed(tree, top, radius, int(counts.max())):
        return None
    for _ in range(MEAN_SHIFTS):
        near = tree.query_ball_point(top, radius)
        top = displacements[near].mean(axis=0)
    return places[near].mean(axis=0), top


def _is_believed(tree: cKDTree, top: FloatArray, radius: float, count: int) -> bool:
    """Whether fog would hardly make a heap of so many pairs, one of which is its middle.

    The shell around a heap is 7 times as large, of displacements within a layer 3 times, along a jet once: taken twice.
    """
    even = (tree.n - 1) * (radius / REACH_VOXEL) ** 3
    around = len(tree.query_ball_point(top, 2 * radius)) - count
    chance = tree.n * gammainc(count - 1, max(even, around / 2))
    return bool(chance < CHANCE)
