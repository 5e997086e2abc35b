"""Images of opaque discs of known size, drawn without any code of the product."""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

FINER = 8
SHAPE = (160, 220)
LIGHT = 180.0
Disc = tuple[float, float, float]
"""Column, row, diameter in px."""
PLACES = [(22.3 + 35 * column, 24.6 + 37 * row) for row in range(4) for column in range(6)]
"""Of 24 discs that do not touch."""
SIZES_PX = np.random.default_rng(4).uniform(9, 19, len(PLACES))
SMALL = np.argsort(SIZES_PX)[:8]


def shadow(discs: Sequence[Disc], blur_px: float = 0.0, noise: float = 0.0, light: Any = LIGHT) -> NDArray[np.float32]:
    """Opaque discs before a light; by many samples per pixel, so that the area is exact to 0.2 %."""
    rows, columns = ((np.arange(n * FINER) + 0.5) / FINER - 0.5 for n in SHAPE)
    covered = np.zeros((len(rows), len(columns)), bool)
    for x_px, y_px, diameter_px in discs:
        near = np.ix_(np.abs(rows - y_px) <= diameter_px / 2, np.abs(columns - x_px) <= diameter_px / 2)
        covered[near] |= (columns[near[1]] - x_px) ** 2 + (rows[near[0]] - y_px) ** 2 <= (diameter_px / 2) ** 2
    coverage = covered.reshape(SHAPE[0], FINER, SHAPE[1], FINER).mean(axis=(1, 3))
    dark = gaussian_filter(coverage, blur_px) if blur_px else coverage
    image = light * (1 - 0.95 * dark) + np.random.default_rng(3).normal(0, noise * LIGHT, SHAPE)
    return np.asarray(image, np.float32)


def spread_discs(scale: float = 1.0, aside_px: float = 0.0, some: NDArray[np.intp] | slice = slice(None)) -> list[Disc]:
    """The 24 discs, or some of them, scaled and moved."""
    drawn = [(x + aside_px, y + aside_px, scale * size) for (x, y), size in zip(PLACES, SIZES_PX.tolist(), strict=True)]
    return [drawn[index] for index in np.arange(len(drawn))[some]]


def noisy(light: NDArray[np.floating], noise: float = 0.01, seed: int = 0) -> NDArray[np.float32]:
    """Grey values of 8 bits of a light that is 1 where it is free."""
    grey = 170 * (light + np.random.default_rng(seed).normal(0, noise, SHAPE))
    return np.asarray(np.clip(np.rint(grey), 0, 255), np.float32)


def seen(drawn: list[Disc], depth: float = 1.0, blur_px: float = 0.8) -> NDArray[np.float64]:
    """Light behind discs that are so dark."""
    return np.asarray(1 - depth * (1 - shadow(drawn, blur_px) / LIGHT), np.float64)


def out_of_focus(drawn: list[Disc]) -> NDArray[np.float64]:
    """Behind a ring of 16 px, as a round pupil with something in its middle is out of focus."""
    distance_px = np.hypot(*np.mgrid[-9:10, -9:10])
    pupil = ((distance_px <= 8) & (distance_px >= 4)).astype(np.float64)
    return np.asarray(cv2.filter2D(seen(drawn, blur_px=0.5), -1, pupil / pupil.sum()), np.float64)
