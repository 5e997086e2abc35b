"""The level of an image without droplets, where it varies slowly: scattered light, glare, a lamp that changed."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from processing.geometry import FloatArray

STEPS = 4
"""Where the level is not even within a cell its quantile is one of the slope, too, until the slope is known."""


def smooth_level(image: NDArray[np.float32], cell_px: int, share: float = 0.5) -> NDArray[np.float32]:
    """Surface (rows, columns) below which a share of the pixels lies in every cell of an image.

    It is a spline through the middles of the cells: it follows what varies over two cells or more.

    Parameters
    ----------
    image : (rows, columns) float32 array
        Of any unit.
    cell_px : int
        Width and height of a cell, about.
    share : float
        Between 0 and 1; a half makes the median.
    """
    down, along = (_spread(size_px, cell_px) for size_px in image.shape)
    level = np.zeros_like(image)
    for _ in range(STEPS):
        level += (down @ _quantiles(image - level, cell_px, share) @ along.T).astype(np.float32)
    return level


def _quantiles(image: NDArray[np.float32], cell_px: int, share: float) -> FloatArray:
    """Of the cells (M, N) of an image; a few rows and columns are left out, so that all have as many pixels."""
    rows, columns = (_sampled(size_px, cell_px) for size_px in image.shape)
    cells = image[np.ix_(rows.ravel(), columns.ravel())].reshape(*rows.shape, *columns.shape)
    return np.asarray(np.quantile(cells, share, axis=(1, 3)), np.float64)


def _sampled(size_px: int, cell_px: int) -> NDArray[np.intp]:
    """Rows, or columns, of N cells (N, pixels)."""
    count, width_px = max(1, size_px // cell_px), min(size_px, cell_px)
    return np.linspace(0, size_px - 1, count * width_px).round().astype(np.intp).reshape(count, width_px)


@lru_cache(maxsize=32)
def _spread(size_px: int, cell_px: int) -> FloatArray:
    """Splines (size_px, N) that are 1 in the middle of one of N cells, and 0 in the middles of the others."""
    count = len(_sampled(size_px, cell_px))
    middles_px = (np.arange(count) + 0.5) * size_px / count - 0.5
    if count == 1:
        return np.ones((size_px, 1))
    return np.asarray(CubicSpline(middles_px, np.eye(count), bc_type="natural")(np.arange(size_px)), np.float64)
