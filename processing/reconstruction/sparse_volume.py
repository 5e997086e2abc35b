"""SparseVolume: a volume that is stored where it is not empty, whether line of sight or SMART made it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing.kernels import DEFAULT_THREADS, _native
from processing.reconstruction.choices import VoxelType
from processing.reconstruction.planning.fixed_point import FixedPoint
from processing.reconstruction.planning.plan import Plan
from processing.reconstruction.slab_volume import SlabVolume, slabs_in

NEGLIGIBLE = 1e-8
"""Blocks in which MLOS is nowhere brighter than this share of what it could be stay empty."""
SEARCH_ROWS = _native.BLOCK_ROWS
"""Rows in which the brightest voxel is looked for at a time."""

FAR_FROM_ONE = 256.0
"""Images so much brighter or darker than 1 leave no room in float16 for their voxels."""


@dataclass(frozen=True, eq=False)
class SparseVolume:
    """A volume in blocks of 8 x 32 voxels of one plane, as fine as float16; zero elsewhere.

    Parameters
    ----------
    blocks : Blocks
        Where the kernels keep it.
    unit : float
        Intensity of a 1 in them.
    """

    blocks: _native.Blocks
    unit: float = 1.0

    @classmethod
    def of_sight(
        cls,
        plan: Plan,
        resampled: Sequence[FixedPoint],
        exponent: float = 1.0,
        *,
        threads: int = DEFAULT_THREADS,
        memory: "SparseVolume | None" = None,
    ) -> "SparseVolume":
        """MLOS, or a power of it.

        Parameters
        ----------
        plan : Plan
            Geometry of views and grid.
        resampled : sequence of FixedPoint
            What ``Plan.resample`` made of one image per view.
        exponent : float
            Of the product of what the views see.
        threads : int
            The result does not depend on it.
        memory : SparseVolume, optional
            It becomes empty and lends its memory.
        """
        most = float(np.prod([image.brightest for image in resampled])) ** exponent
        views, spare = plan.bind(resampled), memory.blocks if memory else None
        floor = NEGLIGIBLE * most
        return cls(_native.Blocks.of_views(views, plan.grid.shape, exponent, floor, most, threads, spare))

    @classmethod
    def of(
        cls, volume: NDArray[np.float32], *, threads: int = DEFAULT_THREADS, memory: "SparseVolume | None" = None
    ) -> "SparseVolume":
        """A volume (z, y, x) of float32, not negative; ``memory`` becomes empty and lends its memory."""
        spare = memory.blocks if memory else None
        return cls(_native.Blocks.of_volume(volume, float(volume.max()), threads, spare))

    @property
    def nbytes(self) -> int:
        """Memory of the blocks."""
        return self.blocks.nbytes

    def dense(self, out: NDArray[Any] | None = None, *, threads: int = DEFAULT_THREADS) -> NDArray[Any]:
        """The whole volume.

        Parameters
        ----------
        out : (nz, ny, nx) float32, float16 or uint8 array, optional
            Receives the volume; 255 is 1 where it is of bytes. By default a new float32 one.
        threads : int
            The result does not depend on it.

        Raises
        ------
        ValueError
            ``out`` has another shape, or is of float16 and intensities are far from 1.
        """
        if out is not None and out.dtype == np.float16 and not 1 / FAR_FROM_ONE <= self.unit <= FAR_FROM_ONE:
            raise ValueError(f"float16 has no room for intensities of about {self.unit:.3g}, take float32")
        volume = np.empty(self.blocks.shape, np.float32) if out is None else out
        self.blocks.write(volume, threads, factor=self.unit)
        return volume

    def slabs(self, out: NDArray[Any], threads: int = DEFAULT_THREADS) -> SlabVolume:
        """The volume slab by slab.

        Parameters
        ----------
        out : (nz, rows, nx) float32 or float16 array
            Receives one slab after the other; a multiple of ``BLOCK_ROWS`` rows y, or all.
        threads : int
            The result does not depend on it.
        """
        return SlabVolume(self._written(out, threads), VoxelType(out.dtype.name), self.unit)

    def brightest(self, threads: int = DEFAULT_THREADS) -> float:
        """Largest voxel of the slabs, or 1 where all are empty."""
        nz, _, nx = self.blocks.shape
        memory = np.empty((nz, SEARCH_ROWS, nx), np.float32)
        return max(float(slab.max()) for _, slab in self._written(memory, threads)) or 1.0

    def _written(self, out: NDArray[Any], threads: int) -> Iterator[tuple[int, NDArray[Any]]]:
        for first_row, slab in slabs_in(out, range(self.blocks.shape[1])):
            self.blocks.write(slab, threads, first_row, 1.0)
            yield first_row, slab
