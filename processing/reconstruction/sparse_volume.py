"""SparseVolume: a volume that is stored where it is not empty."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

BRICK_ROWS, BRICK_COLUMNS = 16, 32
"""Voxels of a brick along y and x; it lies in one plane z."""


@dataclass(frozen=True, eq=False)
class SparseVolume:
    """A volume as bricks, each in one plane; zero elsewhere.

    Parameters
    ----------
    shape : tuple[int, int, int]
        Of the whole volume, (nz, ny, nx).
    positions : (n, 3) int32 array
        Index (z, y, x) of the first voxel of every brick: multiples of 1, 16 and 32, no brick twice, in order of y.
    values : (n, 16, 32) float16 array
        Voxels (y, x) of every brick; zero beyond the volume.
    """

    shape: tuple[int, int, int]
    positions: NDArray[np.int32]
    values: NDArray[np.float16]

    @property
    def nbytes(self) -> int:
        """Memory of the bricks."""
        return self.positions.nbytes + self.values.nbytes

    @property
    def occupancy(self) -> float:
        """Share of all bricks of the volume that is stored."""
        nz, ny, nx = self.shape
        return len(self.positions) / (nz * -(-ny // BRICK_ROWS) * -(-nx // BRICK_COLUMNS))

    def dense(self, out: NDArray[Any] | None = None) -> NDArray[Any]:
        """The whole volume, (nz, ny, nx).

        Parameters
        ----------
        out : (nz, ny, nx) float32, float16 or uint8 array, optional
            Receives the volume; 255 is 1 where it is of bytes. By default a new float16 one.

        Raises
        ------
        ValueError
            ``out`` has another shape.
        """
        volume = np.empty(self.shape, np.float16) if out is None else out
        if volume.shape != self.shape:
            raise ValueError(f"volume has shape {volume.shape}, the bricks are of {self.shape}")
        nz, ny, nx = self.shape
        across = -(-nx // BRICK_COLUMNS)
        slab = np.empty((nz, BRICK_ROWS, across, BRICK_COLUMNS), volume.dtype)
        z, y, x = self.positions.T
        for first_row in range(0, ny, BRICK_ROWS):
            here = slice(*np.searchsorted(y, (first_row, first_row + BRICK_ROWS)))
            slab.fill(0)
            slab[z[here], :, x[here] // BRICK_COLUMNS] = _converted(self.values[here], volume.dtype)
            rows = min(BRICK_ROWS, ny - first_row)
            volume[:, first_row : first_row + rows] = slab[:, :rows].reshape(nz, rows, -1)[:, :, :nx]
        return volume


def _converted(values: NDArray[np.float16], dtype: np.dtype[Any]) -> NDArray[Any]:
    counts: NDArray[Any] = values
    if dtype == np.uint8:
        counts = np.clip(values.astype(np.float32) * 255 + np.float32(0.5), 0, 255)
    return counts.astype(dtype)
