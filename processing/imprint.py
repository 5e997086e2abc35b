"""Does a background show the shadows of the exposure that is divided by it? Then these are paler than they were.

A shot that is one of its own backgrounds, or a background that is the mean of a series: all droplets look smaller, and
nothing else shows it.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.preprocessing import Frame, Intensity

ASKED_PX = 300_000
"""About so many pixels of an image are asked, in even steps along rows and columns."""
SHADED = 0.3
"""Missing light of a pixel that lies in a shadow, far above noise."""
NEIGHBOURS = 17
"""Pixels, of those that are asked, along a side of the surroundings that a pixel of the background is compared with."""
OPEN_SHARE = 0.2
"""Of the surroundings that must be free of shadows."""
LIT = 0.05
"""Of the brightest light of a background."""
SATURATED = 0.998
"""Of it: nobody knows how bright it was."""
STRUCTURE = 0.5
"""Of the light around it: a background that is darker beside a shadow has a nozzle there, or dirt."""
FEW = 30
"""Pixels tell nothing."""
LEAST = 0.03
"""Share of the shadows; less of it does no harm to diameters."""
SHIFTS = 24
"""Of the shadows over the background, to learn what chance does."""
SURE = 6.0
"""Standard deviations of chance."""


def imprint(frame: Frame, background: Intensity, dark: Intensity | None = None) -> float:
    """Share of the shadows of an exposure that its background shows as well; 0 where it shows none for sure.

    Parameters
    ----------
    frame : (rows, columns) uint8 or uint16 array
        Grey values.
    background, dark : (rows, columns) float32 array
        As for ``processing.preprocessing.intensity``.
    """
    step = max(1, int(np.sqrt(frame.size / ASKED_PX)))
    coarse = np.s_[::step, ::step]
    below = np.float32(0) if dark is None else dark[coarse]
    full, light = (np.asarray(one[coarse] - below, np.float32) for one in (background, frame))
    most = full.max()
    lit = (full > LIT * most) & (full < SATURATED * most)
    shaded = lit & (light < (1 - SHADED) * full)
    around = _around(full, lit & ~shaded)
    bright = full > np.maximum(LIT * most, STRUCTURE * around)
    told = shaded & (around > 0) & ~_near_structure(~bright & ~shaded)
    rows, columns = np.nonzero(told)
    if len(rows) < FEW:
        return 0.0
    shadow = 1 - light[rows, columns] / full[rows, columns]
    dip = np.where(lit & (around > 0), 1 - full / np.maximum(around, 1e-6), 0)
    share = float(np.median(dip[rows, columns] / shadow))
    if share <= LEAST:  # chance costs most, and would change nothing
        return 0.0
    return share if share > SURE * _by_chance(dip, rows, columns, shadow) else 0.0


def _around(full: NDArray[np.float32], free: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Mean light of the free pixels around each, 0 where there are few."""
    weight = free.astype(np.float32)
    size = (NEIGHBOURS, NEIGHBOURS)
    share, light = cv2.blur(weight, size), cv2.blur(full * weight, size)
    return np.where(share > OPEN_SHARE, light / np.maximum(share, OPEN_SHARE), 0).astype(np.float32)


def _near_structure(structure: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Beside what is dark in the background and no shadow of the exposure: a nozzle shakes, and liquid clings to it."""
    return cv2.dilate(structure.astype(np.uint8), np.ones((NEIGHBOURS, NEIGHBOURS), np.uint8)) > 0


def _by_chance(
    dip: NDArray[np.float32], rows: NDArray[np.intp], columns: NDArray[np.intp], shadow: NDArray[np.float32]
) -> float:
    """Standard deviation of the share if the same shadows lay elsewhere over the background."""
    height, width = dip.shape
    rng = np.random.default_rng(0)
    shifts = zip(rng.integers(NEIGHBOURS, height - NEIGHBOURS, SHIFTS), rng.integers(0, width, SHIFTS), strict=True)
    shares = [np.median(dip[(rows + down) % height, (columns + along) % width] / shadow) for down, along in shifts]
    return float(np.std(shares))
