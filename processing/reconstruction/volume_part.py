"""A part of a volume, a slice or a region, bit by bit as the whole volume has it: seen by the same plan and images.

A plan of a smaller grid would resample the images in another way, and be off by some 1e-4.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity
from processing.reconstruction.byte_slabs import in_bytes
from processing.reconstruction.choices import ReconstructionMethod, VoxelType
from processing.reconstruction.errors import ReconstructionError
from processing.reconstruction.line_of_sight import ROWS_TOGETHER, volume_seen
from processing.reconstruction.planning.fixed_point import FixedPoint
from processing.reconstruction.planning.plan import PLANES_TOGETHER, Plan
from processing.volume import VoxelGrid

_ROWS_AT_ONCE = 2 * ROWS_TOGETHER
"""A block for each of two threads; of the paper's volume 37 MB."""

MOST_VOXELS = 1 << 24
"""Of a part: 256 along each axis, 67 MB of float32."""
RangesMm = Mapping[str, tuple[float, float] | None]
"""From and to along x, y, z; None stands for all of the axis."""


class PartError(ReconstructionError):
    """There is no such part of a volume, or it is too large; the text names the limit."""


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


def part_within(grid: VoxelGrid, ranges_mm: RangesMm) -> Part:
    """The voxels whose centres lie in some ranges; where a range is one place, the plane that is nearest to it."""
    part = Part(**{axis: _within(axis, getattr(grid, f"{axis}_mm"), ranges_mm.get(axis)) for axis in "zyx"})
    if (count := math.prod(part.shape)) > MOST_VOXELS:
        size = " x ".join(map(str, part.shape))
        raise PartError(f"{size} = {count} voxels, limit {MOST_VOXELS}: ask for parts, or download volume.vtkhdf")
    return part


def _within(axis: str, centres_mm: NDArray[np.float64], span_mm: tuple[float, float] | None) -> range:
    if span_mm is None:
        return range(len(centres_mm))
    low_mm, high_mm = span_mm
    if low_mm == high_mm:
        low_mm = high_mm = float(centres_mm[np.abs(centres_mm - low_mm).argmin()])
    begin, end = np.searchsorted(centres_mm, [low_mm, np.nextafter(high_mm, np.inf)]).tolist()
    first_mm, last_mm = float(centres_mm[0]), float(centres_mm[-1])
    if begin >= end or not first_mm <= span_mm[1] or not span_mm[0] <= last_mm:
        asked = f"{axis} from {span_mm[0]:g} to {span_mm[1]:g} mm"
        raise PartError(f"{asked}: no voxel there, the volume has {axis} from {first_mm:g} to {last_mm:g} mm")
    return range(begin, end)


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
