"""SeenExposure: parts of a volume, bit by bit as the whole volume has them, by the same plan and images.

A plan of a smaller grid would resample the images in another way, and be off by some 1e-4.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity
from processing.reconstruction.byte_slabs import in_bytes
from processing.reconstruction.choices import ReconstructionMethod, VoxelType
from processing.reconstruction.line_of_sight import volume_seen
from processing.reconstruction.planning.fixed_point import FixedPoint
from processing.reconstruction.planning.plan import Plan
from processing.reconstruction.volume_part import ROWS_TOGETHER, Part

_ROWS_AT_ONCE = 2 * ROWS_TOGETHER
"""A block for each of two threads; of the paper's volume 37 MB."""


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
        """Intensities of a part of the volume, at the cost of the blocks around it.

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
        around = part.in_blocks(self.plan.grid)
        nz, ny, nx = around.shape
        memory = np.empty((nz, min(_ROWS_AT_ONCE, ny), nx), voxels.computed.value)
        volume, brightest = volume_seen(self.plan, self.images, method, memory, around, threads=threads)
        if voxels is VoxelType.UINT8:
            volume = in_bytes(volume, brightest)
        return part.taken_from(volume, around)
