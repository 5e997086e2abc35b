"""Droplets: what is measured of every droplet of an exposure, a row for each. A value, whatever found them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.geometry import FloatArray
from processing.volume import VoxelGrid

P_REAL_UNKNOWN = "a single shot does not tell a ghost from a droplet; ghost_share says how many there are"
"""Why ``p_real`` is not a number as yet."""
COVARIANCES = ("xx", "xy", "xz", "yy", "yz", "zz")


@dataclass(frozen=True, eq=False)
class Droplets:
    """Droplets of one exposure.

    Parameters
    ----------
    points_mm : (N, 3) array
        Centres.
    covariance_mm2 : (N, 3, 3) array
        Of the centres, by the noise of the images; calibration errors come on top, and are common to all.
    amplitudes : (N,) array
        Height in the images, mean of the views.
    amplitude_sd : (N,) array
        Its standard deviation, likewise.
    views : (N,) int array
        Views that see more than half of the droplet.
    residual : (N,) array
        Root mean square of what the fit leaves around the droplet, over the noise; 1 is noise.
    """

    points_mm: FloatArray
    covariance_mm2: FloatArray
    amplitudes: FloatArray
    amplitude_sd: FloatArray
    views: NDArray[np.int64]
    residual: FloatArray

    @classmethod
    def none(cls) -> "Droplets":
        """No droplets."""
        return cls(np.empty((0, 3)), np.empty((0, 3, 3)), np.empty(0), np.empty(0), np.empty(0, np.int64), np.empty(0))

    def __len__(self) -> int:
        return len(self.amplitudes)

    def within(self, grid: VoxelGrid) -> "Droplets":
        """Those in a grid, to half a voxel beyond its outermost centres, its own volume."""
        index = grid.to_index(self.points_mm)
        inside = np.all((index >= -0.5) & (index < np.array(grid.shape) - 0.5), axis=1)
        return Droplets(
            self.points_mm[inside],
            self.covariance_mm2[inside],
            self.amplitudes[inside],
            self.amplitude_sd[inside],
            self.views[inside],
            self.residual[inside],
        )

    def columns(self) -> dict[str, NDArray[np.generic]]:
        """Columns by their names, as files have them; ``p_real`` is not a number, see ``P_REAL_UNKNOWN``."""
        x_mm, y_mm, z_mm = self.points_mm.T
        covariances = {
            f"cov_{pair}_mm2": self.covariance_mm2[:, "xyz".index(pair[0]), "xyz".index(pair[1])]
            for pair in COVARIANCES
        }
        return {
            "x_mm": x_mm,
            "y_mm": y_mm,
            "z_mm": z_mm,
            "amplitude": self.amplitudes,
            "amplitude_sd": self.amplitude_sd,
            "p_real": np.full(len(self), np.nan),
            "views": self.views,
            "residual": self.residual,
            **covariances,
        }
