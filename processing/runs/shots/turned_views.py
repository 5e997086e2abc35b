"""Do views agree much better if all of them are mirrored, or exchanged in pairs? Then depth is reversed.

What is near looks far then, and only perspective tells, by a few tenths of a pixel away from the middle: the mean
disparity of a view hardly shows it. How many lines of sight meet closely does, and a view that has moved, turned or
zoomed never makes more of them meet in a reversed world.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import accumulate, combinations

import numpy as np

from processing.analysis.near_or_far import AS_SEEN, CLOSE_PX
from processing.calibration.calibration import Calibration
from processing.calibration.droplets.disparity import MIN_VIEWS, measured_box
from processing.calibration.droplets.droplet_images import find_droplets
from processing.calibration.droplets.droplet_matching import match_exposures
from processing.calibration.triangulation import triangulate
from processing.geometry import FloatArray
from processing.preprocessing import Intensity
from processing.volume import VoxelGrid

SEEDS = 300
"""Droplets of an exposure that are followed."""
ENOUGH = 600
"""Droplets of all exposures together, of the view that sees fewest: more exposures are not asked."""
_ASKED = 200
"""Places of a volume."""
Exposures = Sequence[list[FloatArray]]


def meeting_sights(calibration: Calibration, exposures: Iterable[list[FloatArray]]) -> dict[str, int]:
    """At how many droplets lines of sight of all views meet closely, as images are, and if they were turned.

    The cameras of a run are mounted once: exposures of all its shots tell together, the first ones that are enough.
    """
    asked = _enough(exposures)
    if not asked or len(calibration.views) < MIN_VIEWS:
        return {}
    found = {what: _met(calibration, seen) for what, seen in turned(calibration, asked)}
    return {AS_SEEN: _met(calibration, asked), **found}


def sights_in(calibration: Calibration, names: Sequence[str], lights: Sequence[Intensity]) -> dict[str, int]:
    """The same of the images of one exposure, with droplets bright, of some views of a calibration."""
    seen = [find_droplets(np.clip(light, 0, None)) for light in lights]
    views = {name: calibration.views[name] for name in names}
    return meeting_sights(replace(calibration, views=views), [seen])


def _enough(exposures: Iterable[list[FloatArray]]) -> Exposures:
    """The first exposures in which all views see droplets, until these are enough."""
    seen = [exposure for exposure in exposures if all(map(len, exposure))]
    before = accumulate((min(SEEDS, *map(len, exposure)) for exposure in seen), initial=0)
    return [exposure for exposure, count in zip(seen, before, strict=False) if count < ENOUGH]


def reversed_shows_px(calibration: Calibration, grid: VoxelGrid) -> float:
    """How far, root mean square, lines of sight would pass droplets of a grid if all images were mirrored."""
    views = list(calibration.views.values())
    points_mm = grid.to_mm(np.random.default_rng(0).uniform(0, np.array(grid.shape) - 1, (_ASKED, 3)))
    seen_px = np.stack([view.mapping.project(points_mm) for view in views], axis=1)
    seen_px[:, :, 0] = [view.mapping.image_size_px[0] - 1 for view in views] - seen_px[:, :, 0]
    middle_mm = np.tile(points_mm.mean(axis=0), (_ASKED, 1))
    _, left_px = triangulate([view.mapping for view in views], seen_px, middle_mm, iterations=6)
    return float(np.sqrt((left_px**2).sum(axis=2).mean()))


def _met(calibration: Calibration, exposures: Exposures) -> int:
    """At how many droplets lines of sight of all views meet closely."""
    mappings = [view.mapping for view in calibration.views.values()]
    matches = match_exposures(mappings, exposures, measured_box(calibration), 2 * CLOSE_PX, SEEDS)
    beside_px = np.sqrt((matches.disparities_px**2).sum(axis=2).mean(axis=1))
    return int(np.count_nonzero(beside_px < CLOSE_PX))


def turned(calibration: Calibration, exposures: Exposures) -> Iterator[tuple[str, Exposures]]:
    """What may have been mistaken for all views at once, and the droplets as they would have been seen without."""
    names, sizes_px = list(calibration.views), [one.mapping.image_size_px for one in calibration.views.values()]
    mirrored = [
        [np.column_stack([width - 1 - one[:, 0], one[:, 1]]) for one, (width, _) in zip(seen, sizes_px, strict=True)]
        for seen in exposures
    ]
    yield "all images are mirrored left to right, or turned by 180 degrees", mirrored
    for pairs in _exchanges(len(names)):
        if all(sizes_px[one] == sizes_px[other] for one, other in pairs):
            order = list(range(len(names)))
            for one, other in pairs:
                order[one], order[other] = other, one
            told = ", ".join(f"{names[one]} with {names[other]}" for one, other in pairs)
            yield f"views are exchanged, {told}", [[seen[number] for number in order] for seen in exposures]


def _exchanges(count: int) -> Iterator[tuple[tuple[int, int], ...]]:
    """Of three views one pair, of four two."""
    pairs = list(combinations(range(count), 2))
    if count == 3:
        yield from ((pair,) for pair in pairs)
    if count == 4:
        yield from ((pair, other) for pair, other in zip(pairs[:3], pairs[:2:-1], strict=True))
