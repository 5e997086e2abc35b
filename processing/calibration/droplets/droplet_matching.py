"""Droplets of several views that may be one droplet in space.

Two views with well crossing lines of sight propose points, every further view confirms them. All combinations
within the tolerance are kept: which are true shows only when many are looked at together.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from processing.calibration.triangulation import back_project, crossing_angle_rad, steepest_axis, triangulate
from processing.geometry import FloatArray, ViewMapping

MAX_SEEDS = 1500
"""Droplets of the first view that are followed in one shot: enough for a shot, and the work stays bounded."""
_NEIGHBOURS = 4
_LINES_AT_ONCE = 64
"""Their distances from all droplets of a view stay in the cache."""


@dataclass(frozen=True)
class Box:
    """Where droplets are looked for: ranges along x, y and z in mm."""

    lower_mm: tuple[float, float, float]
    upper_mm: tuple[float, float, float]

    @property
    def middle_mm(self) -> FloatArray:
        """Its centre, (3,)."""
        return np.asarray(np.add(self.lower_mm, self.upper_mm) / 2, dtype=np.float64)

    def contains(self, points_mm: FloatArray) -> NDArray[np.bool_]:
        """Which points (N, 3) lie within."""
        inside = (points_mm >= np.array(self.lower_mm)) & (points_mm <= np.array(self.upper_mm))
        return np.asarray(inside.all(axis=1), dtype=np.bool_)

    def cells(self, points_mm: FloatArray, divisions: tuple[int, int, int]) -> NDArray[np.intp]:
        """Number (N,) of the sub-volume each point lies in, of so many along x, y and z."""
        size_mm = np.array(self.upper_mm) - np.array(self.lower_mm)
        index = np.floor((points_mm - np.array(self.lower_mm)) / size_mm * divisions).astype(np.intp)
        inside = np.clip(index, 0, np.array(divisions) - 1)
        return np.asarray(np.ravel_multi_index(tuple(inside.T), divisions), dtype=np.intp)


@dataclass(frozen=True, eq=False)
class Matches:
    """Combinations of droplets that may be one.

    Parameters
    ----------
    points_mm : (N, 3) array
        Where the views together put it.
    disparities_px : (N, n, 2) array
        Seen minus re-projected, by view.
    """

    points_mm: FloatArray
    disparities_px: FloatArray

    def __len__(self) -> int:
        return len(self.points_mm)


def match_droplets(
    mappings: Sequence[ViewMapping],
    droplets_px: Sequence[FloatArray],
    box: Box,
    tolerance_px: float,
    seeds: int = MAX_SEEDS,
) -> Matches:
    """Match the droplets of one exposure.

    Parameters
    ----------
    mappings : sequence of ViewMapping
        The n views, at least two.
    droplets_px : sequence of (N, 2) arrays
        Droplets of each view, in the same order.
    box : Box
        The measured volume.
    tolerance_px : float
        Largest disparity; larger than any drift that is to be found.
    seeds : int
        The brightest droplets of the first view are followed, no more of them.
    """
    first, second = _widest_pair(mappings, box)
    rest = [view for view in range(len(mappings)) if view not in (first, second)]
    order = [first, second, *rest]
    chosen, points_mm = _pairs(
        mappings[first], mappings[second], droplets_px[first][:seeds], droplets_px[second], box, tolerance_px
    )
    for view in rest:
        chosen, points_mm = _confirm(mappings[view], droplets_px[view], chosen, points_mm, tolerance_px)
        found = order[: chosen.shape[1]]
        points_mm, left_px = triangulate(
            [mappings[index] for index in found], _seen(droplets_px, found, chosen), points_mm, iterations=1
        )
        close = (np.linalg.norm(left_px, axis=2) < tolerance_px).all(axis=1)
        chosen, points_mm = chosen[close], points_mm[close]
    seen_px = _seen(droplets_px, order, chosen)[:, np.argsort(order)]
    points_mm, disparities_px = triangulate(mappings, seen_px, points_mm)
    inside = box.contains(points_mm)
    return Matches(points_mm[inside], disparities_px[inside])


def match_exposures(
    mappings: Sequence[ViewMapping],
    exposures: Sequence[Sequence[FloatArray]],
    box: Box,
    tolerance_px: float,
    seeds: int = MAX_SEEDS,
) -> Matches:
    """Match the droplets of several exposures, each by itself; ``exposures`` are the droplets by exposure and view."""
    found = [match_droplets(mappings, droplets_px, box, tolerance_px, seeds) for droplets_px in exposures]
    points_mm, disparities_px = [one.points_mm for one in found], [one.disparities_px for one in found]
    return Matches(np.concatenate(points_mm), np.concatenate(disparities_px))


def _widest_pair(mappings: Sequence[ViewMapping], box: Box) -> tuple[int, int]:
    angles_rad = crossing_angle_rad(mappings, box.middle_mm)
    first, second = np.unravel_index(int(angles_rad.argmax()), angles_rad.shape)
    return int(first), int(second)


def _pairs(
    first: ViewMapping,
    second: ViewMapping,
    first_px: FloatArray,
    second_px: FloatArray,
    box: Box,
    tolerance_px: float,
) -> tuple[NDArray[np.intp], FloatArray]:
    """Droplets (M, 2) of two views whose lines of sight meet in the box, and where (M, 3)."""
    axis = steepest_axis(first, box.middle_mm)
    places_mm = [box.lower_mm[axis], float(box.middle_mm[axis]), box.upper_mm[axis]]
    begin_mm, middle_mm, end_mm = (back_project(first, first_px, box.middle_mm, axis, place) for place in places_mm)
    begin_px, middle_px, end_px = (second.project(points_mm) for points_mm in (begin_mm, middle_mm, end_mm))
    chord_px = end_px - begin_px
    length_px = np.maximum(np.linalg.norm(chord_px, axis=1, keepdims=True), 1e-9)
    along, across = chord_px / length_px, np.column_stack([-chord_px[:, 1], chord_px[:, 0]]) / length_px
    halfway = ((middle_px - begin_px) * along).sum(axis=1) / length_px[:, 0]
    bend_px = ((middle_px - begin_px) * across).sum(axis=1) / (halfway * (1 - halfway))
    seed, partner, offset_px = _close(begin_px, across, second_px, tolerance_px + np.abs(bend_px) / 4)
    position = ((second_px[partner] - begin_px[seed]) * along[seed]).sum(axis=1) / length_px[seed, 0]
    beside_px = offset_px - bend_px[seed] * position * (1 - position)
    near = (np.abs(beside_px) < tolerance_px) & (position > -0.05) & (position < 1.05)
    seed, partner, position = seed[near], partner[near], position[near]
    points_mm = begin_mm[seed] + _depth(position, halfway[seed])[:, None] * (end_mm[seed] - begin_mm[seed])
    pairs = np.column_stack([seed, partner])
    seen_px = np.stack([first_px[pairs[:, 0]], second_px[pairs[:, 1]]], axis=1)
    points_mm, _ = triangulate([first, second], seen_px, points_mm, iterations=1)
    inside = box.contains(points_mm)
    return pairs[inside], points_mm[inside]


def _close(
    begin_px: FloatArray, across: FloatArray, droplets_px: FloatArray, reach_px: FloatArray
) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]:
    """Which lines, of some beginnings and normals (N, 2), and which droplets lie within reach (N,), and how far off."""
    lines, droplets, offsets_px = [np.empty(0, np.intp)], [np.empty(0, np.intp)], [np.empty(0)]
    for first in range(0, len(begin_px), _LINES_AT_ONCE):
        some = slice(first, first + _LINES_AT_ONCE)
        offset_px = across[some] @ droplets_px.T - (across[some] * begin_px[some]).sum(axis=1, keepdims=True)
        line, droplet = np.nonzero(np.abs(offset_px) < reach_px[some, None])
        lines.append(first + line)
        droplets.append(droplet)
        offsets_px.append(offset_px[line, droplet])
    return np.concatenate(lines), np.concatenate(droplets), np.concatenate(offsets_px)


def _depth(position: FloatArray, halfway: FloatArray) -> FloatArray:
    """Share of the way along a line of sight, from the share in the image and where its middle is seen."""
    bend = (0.5 - halfway) / (halfway * (1 - halfway))
    return position + bend * position * (1 - position)


def _confirm(
    mapping: ViewMapping, droplets_px: FloatArray, chosen: NDArray[np.intp], points_mm: FloatArray, tolerance_px: float
) -> tuple[NDArray[np.intp], FloatArray]:
    """The combinations with every droplet of a further view that is close to their points."""
    if not len(droplets_px) or not len(chosen):
        return np.empty((0, chosen.shape[1] + 1), np.intp), np.empty((0, 3))
    neighbours = min(_NEIGHBOURS, len(droplets_px))
    distance_px, index = cKDTree(droplets_px).query(
        mapping.project(points_mm), k=neighbours, distance_upper_bound=2 * tolerance_px
    )
    row, rank = np.nonzero(np.isfinite(np.reshape(distance_px, (len(chosen), neighbours))))
    found = np.reshape(index, (len(chosen), neighbours))[row, rank]
    return np.column_stack([chosen[row], found]), points_mm[row]


def _seen(droplets_px: Sequence[FloatArray], views: Sequence[int], chosen: NDArray[np.intp]) -> FloatArray:
    return np.stack([droplets_px[view][chosen[:, column]] for column, view in enumerate(views)], axis=1)
