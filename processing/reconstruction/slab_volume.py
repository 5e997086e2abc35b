"""SlabVolume: a volume that comes slab by slab along y and never lies in memory as a whole."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing.kernels import _native
from processing.reconstruction.choices import VoxelType

SLAB_ROWS = 8 * _native.BLOCK_ROWS
"""A slab of the paper's volume has 75 MB in float16."""

Slabs = Iterable[tuple[int, NDArray[Any]]]


@dataclass(eq=False)
class Losses:
    """What voxels that were too faint for their type had, counted slab by slab.

    Parameters
    ----------
    lost, kept : int
        Voxels that became 0, and that did not.
    lost_sum, total : float
        Of the intensities of those that became 0, and of all, in a common unit.
    """

    lost: int = 0
    lost_sum: float = 0.0
    kept: int = 0
    total: float = 0.0

    def count(self, *, lost: int, lost_sum: float, kept: int, total: float) -> None:
        """Add those of one more slab."""
        self.lost += lost
        self.lost_sum += lost_sum
        self.kept += kept
        self.total += total

    @property
    def voxel_share(self) -> float:
        """Of the voxels that were not 0."""
        return self.lost / (self.lost + self.kept) if self.lost else 0.0

    @property
    def intensity_share(self) -> float:
        """Of the sum of all intensities."""
        return self.lost_sum / self.total if self.lost else 0.0


@dataclass(frozen=True, eq=False)
class SlabVolume:
    """A volume in slabs.

    Parameters
    ----------
    slabs : iterable of (int, (nz, rows, nx) array)
        First row y and voxels of slabs of ``SLAB_ROWS`` rows, in order; the last has what is left. The memory of a
        slab may be used again for the next one.
    voxels : VoxelType
        How they are stored.
    unit : float
        Intensity of a voxel of 1.
    losses : Losses, optional
        Of bytes, once all slabs have come.
    """

    slabs: Slabs
    voxels: VoxelType
    unit: float
    losses: Losses | None = None

    @classmethod
    def of(cls, volume: NDArray[Any]) -> "SlabVolume":
        """Slabs of a volume (z, y, x) of float32, float16 or uint8, in which 255 is 1."""
        voxels = VoxelType(volume.dtype.name)
        return cls(slabs_of(volume), voxels, voxels.unit)

    def intensities(self) -> Iterator[tuple[int, NDArray[np.float32]]]:
        """The slabs in float32, whatever their type."""
        for first_row, slab in self.slabs:
            yield first_row, np.multiply(slab, np.float32(self.unit), dtype=np.float32)


def slabs_in(memory: NDArray[Any], grid_rows: range) -> Iterator[tuple[int, NDArray[Any]]]:
    """First row and memory of each slab of these rows y of a grid, all in the same memory (nz, rows, nx)."""
    nz, rows, nx = memory.shape
    for first_row in grid_rows[::rows]:
        here = min(rows, grid_rows.stop - first_row)
        yield first_row, memory.reshape(-1)[: nz * here * nx].reshape(nz, here, nx)


def slabs_of(volume: NDArray[Any]) -> Iterator[tuple[int, NDArray[Any]]]:
    """First row and voxels of each slab of a volume (z, y, x), without a copy."""
    for first_row in range(0, volume.shape[1], SLAB_ROWS):
        yield first_row, volume[:, first_row : first_row + SLAB_ROWS]
