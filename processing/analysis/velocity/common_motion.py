"""Where most droplets of a neighbourhood went: the commonest displacement among all pairs of a sub-volume.

A sub-volume is a droplet of A and its nearest neighbours, so that it is small where droplets are dense. Displacements
of all pairs (A, B) within reach are points in a space of their own; the true pairs are a heap there, the wrong ones a
fog. A heap is believed only if fog alone, as dense as it is around the heap, would hardly ever make one, and if no
other heap is nearly as large. No motion need be guessed, and nothing depends on bins.

Where all pairs make no such heap, those of droplets that are as large as each other may: there are fewer wrong ones.
Heaps that share pairs are of one motion; where droplets fly in two, the one of most pairs is told.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.special import gammainc

from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.geometry import FloatArray

REACH_VOXEL = 25.0
"""The largest displacement that is looked for, of most droplets."""
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
"""A second heap of the same droplets that is larger by comparison leaves it open which is right, as in a row of evenly
spaced droplets; one of other droplets is another motion."""
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


@dataclass(frozen=True, eq=False)
class Explained:
    """Displacements that a known motion explains, which make no other motion.

    Parameters
    ----------
    shifts : (N, 3) array
        Where droplets of A should have gone, in voxels.
    within_voxel : float
        So near to it a displacement is explained.
    """

    shifts: FloatArray
    within_voxel: float


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Pairs (A, B) within reach: indices of both, and displacements in voxels."""

    own: Indices
    other: Indices
    displacements: FloatArray

    def where(self, chosen: NDArray[np.intp] | NDArray[np.bool_]) -> "_Pairs":
        return _Pairs(self.own[chosen], self.other[chosen], self.displacements[chosen])


def common_motion(
    first: MovingDroplets,
    second: MovingDroplets,
    reach_voxel: float = REACH_VOXEL,
    explained: Sequence[Explained] = (),
) -> CommonMotion:
    """The commonest displacement of every sub-volume that has one, of the motion in which most droplets fly.

    Parameters
    ----------
    first, second : MovingDroplets
        Of A and of B.
    reach_voxel : float
        The largest displacement that is looked for.
    explained : sequence of Explained
        What is left aside, as the motions in which other droplets fly explain it.
    """
    if not len(first) or not len(second):
        return CommonMotion(np.empty((0, 3)), np.empty((0, 3)))
    pairs = _within_reach(first.places, second.places, reach_voxel)
    for known in explained:
        apart = np.linalg.norm(pairs.displacements - known.shifts[pairs.own], axis=1)
        pairs = pairs.where(apart > known.within_voxel)
    unlike = np.abs(second.log_sizes[pairs.other] - first.log_sizes[pairs.own])
    ends = np.searchsorted(pairs.own, np.arange(len(first) + 1))
    heaps = []
    for window in _windows(first.places):
        chosen = np.concatenate([np.arange(ends[one], ends[one + 1]) for one in window])
        looks = ((chosen[unlike[chosen] < most], radius) for radius, most in LOOKS)
        found = (
            some[near] for some, radius in looks if (near := _heap(pairs.where(some), radius, reach_voxel)) is not None
        )
        if (heap := next(found, None)) is not None:
            heaps.append(heap)
    told = [heaps[one] for one in _of_one_motion(heaps, len(pairs.own))]
    middles = [first.places[pairs.own[heap]].mean(axis=0) for heap in told]
    shifts = [pairs.displacements[heap].mean(axis=0) for heap in told]
    return CommonMotion(np.reshape(middles, (-1, 3)), np.reshape(shifts, (-1, 3)))


def _of_one_motion(heaps: Sequence[Indices], count: int) -> Indices:
    """Which heaps, each the indices of its pairs, are of the motion that most pairs are in."""
    if not heaps:
        return np.empty(0, np.intp)
    rows, columns = np.repeat(np.arange(len(heaps)), [len(heap) for heap in heaps]), np.concatenate(heaps)
    holds = csr_array((np.ones(len(rows)), (rows, columns)), (len(heaps), count))
    shared = (holds @ holds.T).toarray()
    _, motion = connected_components(shared >= FEWEST, directed=False)
    sizes = [len(np.unique(columns[motion[rows] == one])) for one in range(motion.max() + 1)]
    return np.flatnonzero(motion == np.argmax(sizes))


def _windows(first: FloatArray) -> Indices:
    """Indices (W, k) of the droplets of sub-volumes, which overlap; the middle ones do not depend on the order."""
    middles = first[np.lexsort(first.T)][::STRIDE]
    _, windows = cKDTree(first).query(middles, k=range(1, min(NEIGHBOURS, len(first)) + 1))
    return np.asarray(windows, np.intp)


def _within_reach(first: FloatArray, second: FloatArray, reach_voxel: float) -> _Pairs:
    """All pairs within reach, by A."""
    near = cKDTree(first).sparse_distance_matrix(cKDTree(second), reach_voxel, output_type="coo_matrix")
    order = np.lexsort((near.col, near.row))
    own, other = near.row[order].astype(np.intp), near.col[order].astype(np.intp)
    return _Pairs(own, other, second[other] - first[own])


def _heap(pairs: _Pairs, radius: float, reach_voxel: float) -> Indices | None:
    """The pairs of the largest heap; None where fog might be all, or another heap of the same droplets is as large."""
    if len(pairs.own) < FEWEST:
        return None
    tree = cKDTree(pairs.displacements)
    counts = np.asarray(tree.query_ball_point(pairs.displacements, radius, return_length=True))
    top, most = pairs.displacements[np.argmax(counts)], int(counts.max())
    if most < FEWEST or _rival(pairs, top, radius) > RIVAL * most:
        return None
    if not _is_believed(tree, top, radius, most, reach_voxel):
        return None
    for _ in range(MEAN_SHIFTS):
        near = tree.query_ball_point(top, radius)
        top = pairs.displacements[near].mean(axis=0)
    return np.asarray(near, np.intp)


def _rival(pairs: _Pairs, top: FloatArray, radius: float) -> int:
    """Pairs of the largest heap elsewhere that is made by droplets of the heap around a top."""
    apart = np.linalg.norm(pairs.displacements - top, axis=1)
    inside = apart < radius
    shared = np.isin(pairs.own, pairs.own[inside]) | np.isin(pairs.other, pairs.other[inside])
    rivals = pairs.displacements[shared & (apart > 2 * radius)]
    counts = cKDTree(rivals).query_ball_point(rivals, radius, return_length=True) if len(rivals) else np.zeros(1)
    return int(np.max(counts))


def _is_believed(tree: cKDTree, top: FloatArray, radius: float, count: int, reach_voxel: float) -> bool:
    """Whether fog would hardly make a heap of so many pairs, one of which is its middle.

    The shell around a heap is 7 times as large, of displacements within a layer 3 times, along a jet once: taken twice.
    """
    even = (tree.n - 1) * (radius / reach_voxel) ** 3
    around = len(tree.query_ball_point(top, 2 * radius)) - count
    chance = tree.n * gammainc(count - 1, max(even, around / 2))
    return bool(chance < CHANCE)
