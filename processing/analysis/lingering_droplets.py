"""Shots that follow each other so quickly that they show the same droplets: intervals over shots take them for others.

No rate, velocity or track need be known. Some droplets of a shot are joined to all those of the next one that are as
large. If droplets linger, many of these ways are one and the same, whatever it is; chance makes no way as common.
"""

from collections import defaultdict
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.droplet_table import sizes_of
from processing.geometry import FloatArray

ALIKE = 0.1
"""Of the natural logarithm of diameter or brightness: within it two droplets may be one."""
MOST_PAIRS, MOST_DROPLETS, FEWEST_DROPLETS = 20, 50, 20
"""Successive shots that are asked, droplets of each that are, and of all together: of fewer nothing is said."""
BY_CHANCE, LEAST_SHARE = 5.0, 0.25
"""Percent of the droplets that have another one as large within the radius of a common way, in their own shot; and
share of the droplets that go a common way where shots are said to show the same ones."""
LARGEST_RADIUS = 0.05
"""Of a common way, over the extent of the droplets: where they are few, hardly another one is near."""
AXES = ("x_mm", "y_mm", "z_mm")

Seen = tuple[FloatArray, FloatArray]
"""Droplets of exposure A of a shot: places in mm, (N, 3), and logarithms of their sizes, (N,)."""


def lingering_told(shots: Sequence[StoredDroplets]) -> tuple[str, ...]:
    """For people: that successive shots show the same droplets, and what is wrong then; nothing where they do not."""
    pairs = _successive(shots)
    asked = sum(map(len, (chosen := [_some(first) for first, _ in pairs])))
    if asked < FEWEST_DROPLETS or not (radius_mm := _radius_mm([first for first, _ in pairs])):
        return ()
    ways_mm = [_ways_mm(first, some, second) for (first, second), some in zip(pairs, chosen, strict=True)]
    count, way_mm = _commonest(np.concatenate(ways_mm), radius_mm)
    if count < LEAST_SHARE * asked:
        return ()
    return (
        f"shots show the same droplets: {100 * min(count / asked, 1.0):.0f} % of those of a shot are in the next one, "
        f"{np.linalg.norm(way_mm):.2g} mm farther on. Intervals and tests over shots take them for others: limits are "
        "too narrow. Take shots so far apart in time that droplets have left the box; what does not move may be dirt",
    )


def _successive(shots: Sequence[StoredDroplets]) -> list[tuple[Seen, Seen]]:
    """Some pairs of shots of a run that follow each other and both have droplets; copies are told elsewhere."""
    runs = defaultdict(list)
    for shot in shots:
        if {*AXES} <= shot.columns.keys():
            runs[shot.provenance.get("run")].append(shot)
    pairs: list[tuple[Seen, Seen]] = []
    for run in runs.values():
        seen = [seen_in_a(shot) for shot in sorted(run, key=lambda shot: float(shot.provenance.get("shot", 0)))]
        pairs += [
            (one, other)
            for one, other in pairwise(seen)
            if len(one[0]) and len(other[0]) and not np.array_equal(one[0], other[0])
        ]
    return [pairs[one] for one in _evenly(len(pairs), MOST_PAIRS)]


def seen_in_a(shot: StoredDroplets) -> Seen:
    """Droplets of exposure A of a shot."""
    of_a = shot.columns["frame"] == "a"
    places_mm = np.column_stack([np.asarray(shot.columns[name], np.float64)[of_a] for name in AXES])
    return places_mm, np.log(sizes_of(shot.columns)[of_a])


def _evenly(count: int, most: int) -> NDArray[np.intp]:
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.intp))


def _some(seen: Seen) -> NDArray[np.intp]:
    return _evenly(len(seen[0]), MOST_DROPLETS)


def _radius_mm(several: Sequence[Seen]) -> float:
    """Within which hardly a droplet has another one as large: what is common within it is no chance."""
    nearest_mm = np.concatenate([_nearest_mm(seen) for seen in several])
    extent_mm = max(float(np.linalg.norm(np.ptp(places_mm, axis=0))) for places_mm, _ in several)
    return min(float(np.percentile(nearest_mm, BY_CHANCE)), LARGEST_RADIUS * extent_mm)


def _nearest_mm(seen: Seen) -> FloatArray:
    """From some droplets to the nearest other one as large; infinite where there is none."""
    places_mm, some = seen[0], _some(seen)
    own, other = _alike(seen, some, seen)
    apart_mm = np.linalg.norm(places_mm[other] - places_mm[some[own]], axis=1)
    apart_mm[some[own] == other] = np.inf
    nearest_mm = np.full(len(some), np.inf)
    np.minimum.at(nearest_mm, own, apart_mm)
    return nearest_mm


def _alike(first: Seen, some: NDArray[np.intp], second: Seen) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Which of some droplets, and which of the second shot, are as large as each other."""
    own, other = np.nonzero(np.abs(first[1][some, None] - second[1]) < ALIKE)
    return own, other


def _ways_mm(first: Seen, some: NDArray[np.intp], second: Seen) -> FloatArray:
    own, other = _alike(first, some, second)
    return np.asarray(second[0][other] - first[0][some[own]])


def _commonest(ways_mm: FloatArray, radius_mm: float) -> tuple[int, FloatArray]:
    """How many ways lie within a radius of a common one, and that one: the fullest cell leads there."""
    if not len(ways_mm):
        return 0, np.zeros(3)
    cells, sizes = np.unique(np.floor(ways_mm / radius_mm), axis=0, return_counts=True)
    tree, way_mm = KDTree(ways_mm), (cells[np.argmax(sizes)] + 0.5) * radius_mm
    for _ in range(3):
        near = tree.query_ball_point(way_mm, radius_mm)
        way_mm = ways_mm[near].mean(axis=0)
    return len(near), way_mm
