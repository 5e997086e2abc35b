"""Does a background show the shadows of the exposure that is divided by it? Then these are paler than they were.

A shot that is one of its own backgrounds, or a background that is the mean of a series: all droplets look smaller, and
nothing else shows it.
"""

from dataclasses import dataclass

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
MANY = 1000
"""Of a quarter of the pixels that are asked: these tell by themselves that a background shows nothing."""
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
    quick = _Shadows.of(frame, background, dark, 2 * step, NEIGHBOURS // 2 + 1)
    if len(quick.told) > MANY and quick.share < LEAST / 2:
        return 0.0
    shadows = _Shadows.of(frame, background, dark, step, NEIGHBOURS)
    if len(shadows.told) < FEW or (share := shadows.share) <= LEAST:  # chance costs most, and would change nothing
        return 0.0
    return share if share > SURE * shadows.by_chance() else 0.0


@dataclass(frozen=True, eq=False)
class _Shadows:
    """Pixels of an exposure that lie in a shadow, and the background there.

    Parameters
    ----------
    told : (N,) int array
        Their indices.
    depth : (N,) array
        Missing share of the light.
    full, around : (rows, columns) arrays
        Light of the background, and its mean around each pixel where no shadow is, 0 where nothing tells that.
    """

    told: NDArray[np.intp]
    depth: NDArray[np.float32]
    full: NDArray[np.float32]
    around: NDArray[np.float32]

    @classmethod
    def of(cls, frame: Frame, background: Intensity, dark: Intensity | None, step: int, neighbours: int) -> "_Shadows":
        """Of every so many rows and columns, with so many of these around each pixel."""
        coarse = np.s_[::step, ::step]
        below = np.float32(0) if dark is None else dark[coarse]
        full, light = (np.asarray(one[coarse] - below, np.float32) for one in (background, frame))
        most = full.max()
        lit = (full > LIT * most) & (full < SATURATED * most)
        shaded = lit & (light < (1 - SHADED) * full)
        around = _around(full, lit & ~shaded, neighbours)
        bright = full > np.maximum(LIT * most, STRUCTURE * around)
        told = np.flatnonzero(shaded & (around > 0) & ~_near(~bright & ~shaded, neighbours))
        return cls(told, 1 - light.ravel()[told] / full.ravel()[told], full, np.where(lit, around, 0))

    @property
    def share(self) -> float:
        """Of them that the background shows as well."""
        there = self.full.ravel()[self.told] / self.around.ravel()[self.told]
        return float(np.median((1 - there) / self.depth))

    def by_chance(self) -> float:
        """Standard deviation of the share if the same shadows lay elsewhere over the background."""
        dip = np.where(self.around > 0, 1 - self.full / np.maximum(self.around, 1e-6), 0)
        height, width = dip.shape
        rows, columns = np.divmod(self.told, width)
        rng = np.random.default_rng(0)
        shifts = zip(rng.integers(NEIGHBOURS, height - NEIGHBOURS, SHIFTS), rng.integers(0, width, SHIFTS), strict=True)
        shares = [
            np.median(dip[(rows + down) % height, (columns + along) % width] / self.depth) for down, along in shifts
        ]
        return float(np.std(shares))


def _around(full: NDArray[np.float32], free: NDArray[np.bool_], neighbours: int) -> NDArray[np.float32]:
    """Mean light of the free pixels around each, 0 where there are few."""
    weight = free.astype(np.float32)
    size = (neighbours, neighbours)
    share, light = cv2.blur(weight, size), cv2.blur(full * weight, size)
    return np.where(share > OPEN_SHARE, light / np.maximum(share, OPEN_SHARE), 0).astype(np.float32)


def _near(structure: NDArray[np.bool_], neighbours: int) -> NDArray[np.bool_]:
    """Beside what is dark in the background and no shadow of the exposure: a nozzle shakes, and liquid clings to it."""
    return cv2.dilate(structure.astype(np.uint8), np.ones((neighbours, neighbours), np.uint8)) > 0
