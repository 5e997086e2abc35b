"""VoxelGrid: where the voxels of a volume lie in space."""

from collections.abc import Iterable
from dataclasses import dataclass
from numbers import Integral, Real

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class VoxelGrid:
    """A regular grid of cubic voxels. Volumes on it are arrays (z, y, x).

    Parameters
    ----------
    shape : tuple[int, int, int]
        Number of voxels (nz, ny, nx).
    origin_mm : tuple[float, float, float]
        Centre of voxel [0, 0, 0], (x, y, z) in mm.
    pitch_mm : float
        Edge length of a voxel in mm.
    """

    shape: tuple[int, int, int]
    origin_mm: tuple[float, float, float]
    pitch_mm: float

    def __post_init__(self) -> None:
        if not _are_three(self.shape, Integral) or min(self.shape) < 1:
            raise ValueError(f"grid: shape {self.shape}: three whole numbers of voxels (nz, ny, nx), please")
        if not _are_three(self.origin_mm, Real) or not np.isfinite(self.origin_mm).all():
            raise ValueError(f"grid: origin {self.origin_mm}: three finite numbers (x, y, z) in mm, please")
        if not _is_number(self.pitch_mm, Real) or not 0 < self.pitch_mm < np.inf:
            raise ValueError(f"grid: pitch {self.pitch_mm!r}: a finite number above 0 in mm, please")

    @classmethod
    def centred(cls, shape: tuple[int, int, int], pitch_mm: float) -> "VoxelGrid":
        """Grid whose centre is the world origin."""
        nz, ny, nx = shape
        x_mm, y_mm, z_mm = (-0.5 * (n - 1) * pitch_mm for n in (nx, ny, nz))
        return cls(shape, (x_mm, y_mm, z_mm), pitch_mm)

    @property
    def x_mm(self) -> NDArray[np.float64]:
        """Coordinates of the voxel centres along x, (nx,)."""
        return self.origin_mm[0] + self.pitch_mm * np.arange(self.shape[2], dtype=np.float64)

    @property
    def y_mm(self) -> NDArray[np.float64]:
        """Coordinates of the voxel centres along y, (ny,)."""
        return self.origin_mm[1] + self.pitch_mm * np.arange(self.shape[1], dtype=np.float64)

    @property
    def z_mm(self) -> NDArray[np.float64]:
        """Coordinates of the voxel centres along z, (nz,)."""
        return self.origin_mm[2] + self.pitch_mm * np.arange(self.shape[0], dtype=np.float64)

    @property
    def volume_mm3(self) -> float:
        """Volume of the whole grid in cubic millimetres."""
        return float(np.prod(self.shape)) * self.pitch_mm**3

    def to_index(self, points_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Fractional voxel indices of points.

        Parameters
        ----------
        points_mm : (N, 3) array
            Points (x, y, z) in mm.

        Returns
        -------
        (N, 3) array
            Indices in the order of a volume, (z, y, x); voxel centres at integers.
        """
        offsets_mm: NDArray[np.float64] = np.asarray(points_mm) - np.asarray(self.origin_mm)
        return offsets_mm[..., ::-1] / self.pitch_mm

    def holds(self, points_mm: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which points (N, 3), x, y, z in mm, lie in a voxel."""
        index = self.to_index(points_mm)
        return np.asarray(np.all((index >= -0.5) & (index < np.array(self.shape) - 0.5), axis=1))

    def to_mm(self, indices: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (x, y, z) in mm of fractional voxel indices (z, y, x); the inverse of ``to_index``."""
        offsets_mm: NDArray[np.float64] = np.asarray(indices)[..., ::-1] * self.pitch_mm
        return offsets_mm + np.asarray(self.origin_mm, dtype=np.float64)


def _are_three(values: object, kind: type) -> bool:
    numbers = tuple(values) if isinstance(values, Iterable) else ()
    return len(numbers) == 3 and all(_is_number(value, kind) for value in numbers)


def _is_number(value: object, kind: type) -> bool:
    """A truth value is none, whatever Python says."""
    return isinstance(value, kind) and not isinstance(value, bool)
