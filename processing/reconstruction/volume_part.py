"""A part of a volume, a slice or a region, bit by bit as the whole volume has it: seen by the same plan and images.

A plan of a smaller grid would resample the images in another way, and be off by some 1e-4.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity
from processing.reconstruction.byte_slabs import in_bytes
from processing.reconstruction.choices import ReconstructionMethod, VoxelType
from processing.reconstruction.line_of_sight import ROWS_TOGETHER, volume_seen
from processing.reconstruction.planning.fixed_point import FixedPoint
from processing.reconstruction.planning.plan import PLANES_TOGETHER, Plan
from processing.volume import VoxelGrid

_ROWS_AT_ONCE = 2 * ROWS_TOGETHER
"""A block for each of two threads; of the paper's volume 37 MB."""


@dataclass(frozen=True)
class Part:
    """Voxels of a grid.

    Parameters
    ----------
    z, y, x : range
        Their indices along each axis, without gaps.
    """

    z: range
    y: range
    x: range

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of voxels (nz, ny, nx)."""
        return len(self.z), len(self.y), len(self.x)

    def grid(self, whole: VoxelGrid) -> VoxelGrid:
        """Where they lie, of the grid that they are a part of."""
        first = np.array([self.z.start, self.y.start, self.x.start], dtype=np.float64)
        x_mm, y_mm, z_mm = whole.to_mm(first).tolist()
        return VoxelGrid(self.shape, (x_mm, y_mm, z_mm), whole.pitch_mm)


@dataclass(frozen=True, eq=False)
class SeenExposure:
    """One exposure as its views see it, from which any part of its volume is made in milliseconds.

    Parameters
    ----------
    plan : Plan
        Of the whole volume.
    images : tuple of FixedPoint
        Resampled by the plan, one per view.
    """

    plan: Plan
    images: tuple[FixedPoint, ...]

    @classmethod
    def of(cls, plan: Plan, images: Sequence[Intensity], threads: int = DEFAULT_THREADS) -> Self:
        """See preprocessed images (rows, columns), one per view."""
        return cls(plan, tuple(plan.resample(images, threads)))

    def part(
        self,
        part: Part,
        method: ReconstructionMethod,
        voxels: VoxelType = VoxelType.FLOAT16,
        threads: int = DEFAULT_THREADS,
    ) -> Intensity:
        """Intensities of a part of the volume.

        It costs what its planes z and rows y cost: 16 planes or rows at least, and all columns x.

        Parameters
        ----------
        part : Part
            Within the grid.
        method : ReconstructionMethod
            GAVLOS, MINLOS or MLOS; ValueError for others.
        voxels : VoxelType
            How finely the whole volume would be kept.
        threads : int
            The result does not depend on it.

        Returns
        -------
        (nz, ny, nx) float32 array
            Those that ``Reconstructor`` makes of these voxels.
        """
        nz, ny, nx = self.plan.grid.shape
        planes, rows = _whole(part.z, PLANES_TOGETHER, nz), _whole(part.y, ROWS_TOGETHER, ny)
        memory = np.empty((len(planes), min(_ROWS_AT_ONCE, len(rows)), nx), voxels.computed.value)
        volume, brightest = volume_seen(
            self.plan.between(planes), self.images, method, memory, rows=rows, threads=threads
        )
        if voxels is VoxelType.UINT8:
            volume = in_bytes(volume, brightest)
        z, x = _slice(part.z, planes.start), _slice(part.x, 0)
        seen = np.empty(part.shape, np.float32)
        for first_row, slab in volume.slabs:
            y = range(max(first_row, part.y.start), min(first_row + slab.shape[1], part.y.stop))
            here: NDArray[np.generic] = slab[z, _slice(y, first_row), x]
            np.multiply(here, np.float32(volume.unit), out=seen[:, _slice(y, part.y.start)], dtype=np.float32)
        return seen


def _whole(some: range, together: int, of: int) -> range:
    """The same indices and more, from a multiple to a multiple, or to the end."""
    return range(some.start // together * together, min(-(-some.stop // together) * together, of))


def _slice(some: range, origin: int) -> slice:
    return slice(some.start - origin, some.stop - origin)
