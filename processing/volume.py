"""VoxelGrid: where the voxels of a volume lie in space."""

from dataclasses import dataclass

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
        if min(self.shape) < 1 or not 0 < self.pitch_mm < np.inf:
            raise ValueError(f"grid needs voxels: shape {self.shape}, pitch {self.pitch_mm} mm")
        if any(int(count) != count for count in self.shape) or not np.isfinite(self.origin_mm).all():
            raise ValueError(f"grid has whole voxels at finite places: shape {self.shape}, origin {self.origin_mm} mm")

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

    def to_mm(self, indices: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (x, y, z) in mm of fractional voxel indices (z, y, x); the inverse of ``to_index``."""
        offsets_mm: NDArray[np.float64] = np.asarray(indices)[..., ::-1] * self.pitch_mm
        return offsets_mm + np.asarray(self.origin_mm, dtype=np.float64)
