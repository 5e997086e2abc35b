"""Views that agree nearly as they are, and fully if all of them are mirrored, or exchanged in pairs.

Then depth is reversed: what is near looks far, and only perspective tells, by a few tenths of a pixel. A view that has
moved by as much looks alike, so both are tried.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from processing.calibration.calibration import Calibration
from processing.geometry import FloatArray

Exposures = Sequence[list[FloatArray]]


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
