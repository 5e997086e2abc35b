"""Images of opaque discs of known size, drawn without any code of the product."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

FINER = 8
SHAPE = (160, 220)
LIGHT = 180.0
Disc = tuple[float, float, float]
"""Column, row, diameter in px."""


def shadow(discs: Sequence[Disc], blur_px: float = 0.0, noise: float = 0.0, light: Any = LIGHT) -> NDArray[np.float32]:
    """Opaque discs before a light; by many samples per pixel, so that the area is exact to 0.2 %."""
    row, column = np.mgrid[: SHAPE[0] * FINER, : SHAPE[1] * FINER]
    row, column = (row + 0.5) / FINER - 0.5, (column + 0.5) / FINER - 0.5
    covered = np.zeros(row.shape, bool)
    for x_px, y_px, diameter_px in discs:
        covered |= (column - x_px) ** 2 + (row - y_px) ** 2 <= (diameter_px / 2) ** 2
    coverage = covered.reshape(SHAPE[0], FINER, SHAPE[1], FINER).mean(axis=(1, 3))
    dark = gaussian_filter(coverage, blur_px) if blur_px else coverage
    image = light * (1 - 0.95 * dark) + np.random.default_rng(3).normal(0, noise * LIGHT, SHAPE)
    return np.asarray(image, np.float32)
