"""Part: voxels of a grid, a slice or a region; and how they are taken out of the blocks that the kernels make."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from processing.kernels import _native
from processing.preprocessing import Intensity
from processing.reconstruction.errors import ReconstructionError
from processing.reconstruction.slab_volume import SlabVolume
from processing.volume import VoxelGrid

PLANES_TOGETHER = max(_native.NODE_SPACINGS)
"""There every view has its nodes."""
ROWS_TOGETHER = 2 * _native.BLOCK_ROWS
COLUMNS_TOGETHER = _native.BLOCK_COLUMNS
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

    @classmethod
    def all_of(cls, grid: VoxelGrid) -> Self:
        """All voxels of a grid."""
        return cls(*map(range, grid.shape))

    @classmethod
    def plane(cls, grid: VoxelGrid, axis: int, index: int) -> Self:
        """One plane across an axis (0 is z, 1 is y, 2 is x)."""
        ranges = [range(n) for n in grid.shape]
        ranges[axis] = range(index, index + 1)
        return cls(*ranges)

    def in_blocks(self, grid: VoxelGrid) -> "Part":
        """The blocks around it, which the kernels make as they make them for the whole grid."""
        nz, ny, nx = grid.shape
        return Part(
            _whole(self.z, PLANES_TOGETHER, nz), _whole(self.y, ROWS_TOGETHER, ny), _whole(self.x, COLUMNS_TOGETHER, nx)
        )

    def of(self, volume: NDArray[Any]) -> NDArray[Any]:
        """These voxels of a whole volume, not copied."""
        return volume[_slice(self.z, 0), _slice(self.y, 0), _slice(self.x, 0)]

    def taken_from(self, blocks: SlabVolume, around: "Part") -> Intensity:
        """Intensities (nz, ny, nx) of these voxels, out of slabs of the blocks around them."""
        z, x = _slice(self.z, around.z.start), _slice(self.x, around.x.start)
        taken = np.empty(self.shape, np.float32)
        for first_row, slab in blocks.slabs:
            y = range(max(first_row, self.y.start), min(first_row + slab.shape[1], self.y.stop))
            here: NDArray[Any] = slab[z, _slice(y, first_row), x]
            np.multiply(here, np.float32(blocks.unit), out=taken[:, _slice(y, self.y.start)], dtype=np.float32)
        return taken

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


def _whole(some: range, together: int, of: int) -> range:
    """The same indices and more, from a multiple to a multiple, or to the end."""
    return range(some.start // together * together, min(-(-some.stop // together) * together, of))


def _slice(some: range, origin: int) -> slice:
    return slice(some.start - origin, some.stop - origin)
