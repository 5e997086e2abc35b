"""Images resampled as a textbook writes it: float64, numpy, and the mapping itself wherever a pixel lies."""

import numpy as np
from numpy.typing import NDArray

from processing.geometry import ViewMapping
from processing.reconstruction.planning.rectified_view import MAP_SPACING_PX, RectifiedView
from processing.volume import VoxelGrid
from tests.support.oracle import Array, bilinear

KEYS_SLOPE = -0.6
"""Of the cubic kernel at distance 1 (a of Keys 1981)."""


def keys(distance: Array) -> Array:
    """Keys' kernel, as his equation 4 has it."""
    a, d = KEYS_SLOPE, np.abs(distance)
    near, far = (a + 2) * d**3 - (a + 3) * d**2 + 1, a * (d**3 - 5 * d**2 + 8 * d - 4)
    return np.where(d < 1, near, np.where(d < 2, far, 0.0))


def keys_slope(distance: Array) -> Array:
    """The derivative of Keys' kernel."""
    a, d = KEYS_SLOPE, np.abs(distance)
    near, far = 3 * (a + 2) * d**2 - 2 * (a + 3) * d, a * (3 * d**2 - 10 * d + 8)
    return np.sign(distance) * np.where(d < 1, near, np.where(d < 2, far, 0.0))


def convolve(image: NDArray[np.floating], u: Array, v: Array) -> tuple[Array, Array]:
    """Cubic convolution of an image that is surrounded by zeros; and how steep it is, |d/du| + |d/dv|."""
    framed = np.pad(np.asarray(image, dtype=np.float64), 4)
    u, v = (np.clip(at, -3, n + 2) for at, n in zip((u, v), image.shape[::-1], strict=True))
    first_u, first_v = np.floor(u).astype(int), np.floor(v).astype(int)
    value, along_u, along_v = np.zeros((3, *u.shape))
    for down, right in np.ndindex(4, 4):
        row, column = first_v + down - 1, first_u + right - 1
        pixel = framed[np.minimum(row + 4, image.shape[0] + 7), np.minimum(column + 4, image.shape[1] + 7)]
        value += keys(u - column) * keys(v - row) * pixel
        along_u += keys_slope(u - column) * keys(v - row) * pixel
        along_v += keys(u - column) * keys_slope(v - row) * pixel
    return value, np.abs(along_u) + np.abs(along_v)


def shown_positions(
    mapping: ViewMapping, grid: VoxelGrid, view: RectifiedView, rows: Array, columns: Array
) -> tuple[Array, Array]:
    """Columns and rows of the recorded image that pixels of a rectified one show.

    A pixel shows the voxel (z, y, x) that is seen in it, whatever z: here of the middle plane.
    """
    z = grid.shape[0] // 2
    row, column = np.meshgrid(rows, columns, indexing="ij")
    y, x = (row - view.shift_v_px[z]) / view.scale[z], (column - view.shift_u_px[z]) / view.scale[z]
    voxels = np.stack([np.full(row.shape, float(z)), y, x], axis=-1)
    image_px = mapping.project(grid.to_mm(voxels.reshape(-1, 3))).reshape(*row.shape, 2)
    return image_px[..., 0], image_px[..., 1]


def positions_between_nodes(mapping: ViewMapping, grid: VoxelGrid, view: RectifiedView) -> tuple[Array, Array]:
    """The same for all pixels, known at every sixteenth and linear in between."""
    nodes = [MAP_SPACING_PX * np.arange(n // MAP_SPACING_PX + 2, dtype=np.float64) for n in view.shape_px]
    between = np.meshgrid(*(np.arange(n) / MAP_SPACING_PX for n in view.shape_px), indexing="ij")
    u, v = (bilinear(at, between[1], between[0]) for at in shown_positions(mapping, grid, view, *nodes))
    return u, v


def averaged(image: NDArray[np.floating], binning: int) -> Array:
    """Means of ``binning`` by ``binning`` pixels; what is left at the right and at the bottom is nowhere."""
    height, width = (n // binning for n in image.shape)
    means = [
        np.mean(image[binning * row : binning * (row + 1), binning * column : binning * (column + 1)], dtype=np.float64)
        for row, column in np.ndindex(height, width)
    ]
    return np.array(means).reshape(height, width)
