"""DarkVoxels: where all views are dark, as a list; and which of these voxels hang together.

This is the *visual hull*: the most that may be liquid. A list takes memory for what is dark alone, a volume for all.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from processing.geometry import FloatArray
from processing.volume import VoxelGrid

MOST_VOXELS = 6_000_000
"""So many dark voxels are listed; with more of them, 2 GB, all is one, and nothing is known."""
FULL = 255
"""Of bytes: no light."""


@dataclass(frozen=True, eq=False)
class DarkVoxels:
    """Voxels of a grid that all views see dark.

    Parameters
    ----------
    grid : VoxelGrid
        Of which they are some.
    numbers : (N,) int64 array
        Of the voxels in the flat grid (z, y, x), ascending.
    darkness : (N,) uint8 array
        Of the view that sees the most light there; 255 is none.
    """

    grid: VoxelGrid
    numbers: NDArray[np.int64]
    darkness: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.numbers)

    def where(self, chosen: NDArray[np.bool_]) -> "DarkVoxels":
        """The chosen ones."""
        return DarkVoxels(self.grid, self.numbers[chosen], self.darkness[chosen])

    def at_least(self, threshold: float) -> "DarkVoxels":
        """Those that are so dark in all views."""
        return self.where(self.darkness >= threshold * FULL)

    @property
    def indices(self) -> NDArray[np.int64]:
        """Of the voxels (N, 3) z, y, x."""
        return np.stack(np.unravel_index(self.numbers, self.grid.shape), axis=1)

    @property
    def points_mm(self) -> FloatArray:
        """Their centres (N, 3) x, y, z."""
        return self.grid.to_mm(self.indices.astype(np.float64))


def dark_voxels(slabs: Iterable[tuple[int, NDArray[Any]]], grid: VoxelGrid, least: float) -> DarkVoxels:
    """List the dark voxels of a volume that comes in slabs.

    Parameters
    ----------
    slabs : iterable of (int, (nz, rows, nx) uint8 array)
        First row y, and the least intensity of any view: MINLOS, 255 is 1.
    grid : VoxelGrid
        Of the whole volume.
    least : float
        Intensity from which on a voxel is dark.

    Raises
    ------
    ValueError
        More than ``MOST_VOXELS`` are dark.
    """
    numbers, darkness, count = [], [], 0
    _, ny, nx = grid.shape
    for first_row, slab in slabs:
        z, y, x = np.nonzero(slab >= least * FULL)
        count += len(z)
        if count > MOST_VOXELS:
            raise ValueError(f"more than {MOST_VOXELS} voxels are dark in all views")
        numbers.append((z.astype(np.int64) * ny + y + first_row) * nx + x)
        darkness.append(slab[z, y, x])
    flat = np.concatenate(numbers)
    order = np.argsort(flat)
    return DarkVoxels(grid, flat[order], np.concatenate(darkness)[order].astype(np.uint8))


def connected(voxels: DarkVoxels) -> NDArray[np.int32]:
    """Number (N,) of the object of each voxel, from 0; voxels hang together by their faces."""
    _, ny, nx = voxels.grid.shape
    numbers = voxels.numbers
    along_x = np.flatnonzero((np.diff(numbers) == 1) & (numbers[1:] % nx != 0))
    along_y = _neighbours(numbers, nx, (numbers // nx) % ny != ny - 1)
    along_z = _neighbours(numbers, nx * ny, np.ones(len(numbers), bool))
    one, other = np.concatenate([np.stack([along_x, along_x + 1]), along_y, along_z], axis=1)
    links = coo_matrix((np.ones(len(one), bool), (one, other)), shape=(len(numbers),) * 2)
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int32)


def _neighbours(numbers: NDArray[np.int64], step: int, has_next: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Pairs (2, M) of places in the list of voxels so far apart."""
    place = np.searchsorted(numbers, numbers + step)
    place[place == len(numbers)] = 0
    found = np.flatnonzero((numbers[place] == numbers + step) & has_next)
    return np.stack([found, place[found]])
