"""Are the droplets of single images counted more often than once? Images do not say what they are of.

Both exposures may lie in one image, one above or beside the other; two images may be A and B, or frames of a film; and
dust on a window is in the same place in all of them. Such droplets agree in size, and in how far they lie apart.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from processing.analysis.common_way import LEAST, common_way, ways_between
from processing.geometry import FloatArray

MOST_DROPLETS = 300
"""Of an image, the largest: they are enough to tell."""
ALIKE = 0.12
"""Difference of two diameters, as logarithms."""
SPREAD_PX = 6.0
"""Droplets that move together differ by no more."""
STILL_PX = 1.0
"""Dust does not move."""
SHARE = 0.5
"""So many of those that could be there twice must be."""
LEAST_STILL = 3
"""Spots that stand still."""
ONWARDS = np.array([0.6, 0.8])
"""Ways within an image are counted in this direction: right or down."""

Discs = tuple[FloatArray, FloatArray]
"""Centres (N, 2) and diameters (N,) in px."""


def counted_twice(images: Mapping[str, Discs]) -> tuple[str, ...]:
    """What is counted more than once in images by name, in their order; a sentence of each kind, with an example."""
    names, halves, moved, still = list(images), {}, {}, {}
    for name, following in zip(names, [*names[1:], ""], strict=True):
        if told := _twice_in_image(images[name]):
            halves[name] = told
        if following:
            steps_px, ratios = _steps(_largest(images[name]), _largest(images[following]))
            if told := _moved(steps_px, ratios, min(len(images[name][1]), len(images[following][1]))):
                moved[f"{name} and {following}"] = told
            elif (count := int(np.count_nonzero(_still(steps_px, ratios)))) >= LEAST_STILL:
                still[f"{name} and {following}"] = f"{count} droplets are in both, in the same place"
    said = (
        (halves, "are both exposures in one image? Their droplets count twice; cut it in two"),
        (
            moved,
            "are these A and B, or frames of a film? Droplets count twice, and means are less sure than they say",
        ),
        (still, "is it dust on a window? It counts in every image; give the light without droplets (--background)"),
    )
    return tuple(_told(cases, asks) for cases, asks in said if cases)


def _told(cases: Mapping[str, str], asks: str) -> str:
    first, what = next(iter(cases.items()))
    more = f", and in {len(cases) - 1} more cases" if len(cases) > 1 else ""
    return f"{first}: {what}{more}: {asks}"


def _twice_in_image(droplets: Discs) -> str:
    """Half of the droplets of an image are the other half, moved; empty where they are not."""
    centres_px, diameters_px = _largest(droplets)
    one, other = np.triu_indices(len(diameters_px), 1)
    apart_px, count = _agreement(ways_between(centres_px, ONWARDS), diameters_px[other] / diameters_px[one])
    if count < max(LEAST, SHARE * len(diameters_px) / 2):
        return ""
    along_px, down_px = np.abs(apart_px)
    return f"{count} of its droplets are there again {down_px:.0f} rows and {along_px:.0f} columns away"


def _moved(steps_px: FloatArray, ratios: FloatArray, fewer: int) -> str:
    apart_px, count = _agreement(steps_px, ratios)
    if count < max(LEAST, SHARE * min(fewer, MOST_DROPLETS)) or np.hypot(*apart_px) <= STILL_PX:
        return ""
    return f"{count} droplets are in both, {apart_px[0]:.0f} columns and {apart_px[1]:.0f} rows on"


def _steps(one: Discs, other: Discs) -> tuple[FloatArray, FloatArray]:
    """From every droplet to every one of the other image: the way (N, 2), and the ratio of diameters (N,)."""
    ways_px = other[0][None] - one[0][:, None]
    return ways_px.reshape(-1, 2), (other[1][None] / one[1][:, None]).ravel()


def _still(steps_px: FloatArray, ratios: FloatArray) -> NDArray[np.bool_]:
    return np.asarray((np.hypot(*steps_px.T) < STILL_PX) & _alike(ratios))


def _largest(droplets: Discs) -> Discs:
    centres_px, diameters_px = droplets
    kept = np.argsort(diameters_px)[::-1][:MOST_DROPLETS]
    return centres_px[kept], diameters_px[kept]


def _alike(ratios: FloatArray) -> NDArray[np.bool_]:
    return np.asarray(np.abs(np.log(ratios)) < ALIKE)


def _agreement(steps_px: FloatArray, ratios: FloatArray) -> tuple[FloatArray, int]:
    """The way that most pairs of droplets alike have in common, and how many; 0 if other ways do nearly as well."""
    return common_way(steps_px[_alike(ratios)], SPREAD_PX)
