"""Droplets: what is measured of every droplet of an exposure, a row for each. A value, whatever found them."""

from dataclasses import dataclass, fields, replace
from typing import Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from processing.geometry import FloatArray
from processing.volume import VoxelGrid

P_REAL_TRIED = (
    "not a number where it was not tried: in shots whose verdict is not good, with more or less than four views, where "
    "not all four know a droplet, among more crowded or wider spots than were tried, in coherent light, "
    "beside ligaments and the like"
)
"""Why ``p_real`` may not be a number."""
COVARIANCES = ("xx", "xy", "xz", "yy", "yz", "zz")
Columns = dict[str, NDArray[np.generic]]


def sizes_of(columns: Columns) -> FloatArray:
    """How large droplets are (N,), in um, or else how bright, by their columns: what makes two of them look alike."""
    return np.asarray(columns["diameter_um" if "diameter_um" in columns else "amplitude"], np.float64)


class DropletRows(Protocol):
    """Droplets of one exposure, a row each, whatever is known of them beside their place."""

    @property
    def points_mm(self) -> FloatArray:
        """Centres (N, 3)."""

    @property
    def p_real(self) -> FloatArray:
        """Probability that each is no ghost; not a number where that was not tried."""

    @property
    def sized(self) -> bool:
        """Whether they have diameters, as shadows do."""

    def __len__(self) -> int: ...

    def within(self, grid: VoxelGrid) -> Self:
        """Those in a grid, to half a voxel beyond its outermost centres, its own volume."""

    def unsure(self) -> Self:
        """The same, of none of which is told how probably it is real."""

    def columns(self) -> Columns:
        """Columns by their names, as files have them."""


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
    p_real : (N,) array
        Probability that it is no ghost; not a number where that was not tried.
    """

    points_mm: FloatArray
    covariance_mm2: FloatArray
    amplitudes: FloatArray
    amplitude_sd: FloatArray
    views: NDArray[np.int64]
    residual: FloatArray
    p_real: FloatArray

    @property
    def sized(self) -> bool:
        """Whether they have diameters."""
        return False

    @classmethod
    def none(cls) -> "Droplets":
        """No droplets."""
        empty = np.empty(0)
        return cls(np.empty((0, 3)), np.empty((0, 3, 3)), empty, empty, np.empty(0, np.int64), empty, empty)

    def __len__(self) -> int:
        return len(self.amplitudes)

    def within(self, grid: VoxelGrid) -> "Droplets":
        """Those in a grid, to half a voxel beyond its outermost centres, its own volume."""
        return _rows(self, grid.holds(self.points_mm))

    def unsure(self) -> "Droplets":
        """The same, of none of which is told how probably it is real."""
        return replace(self, p_real=np.full(len(self), np.nan))

    def columns(self) -> Columns:
        """Columns by their names, as files have them."""
        return {
            **_places(self.points_mm),
            "amplitude": self.amplitudes,
            "amplitude_sd": self.amplitude_sd,
            **_sureness(self.p_real, self.views, self.residual, self.covariance_mm2),
        }


@dataclass(frozen=True, eq=False)
class SizedDroplets:
    """Droplets of one exposure with their sizes: of shadows.

    Parameters
    ----------
    points_mm, covariance_mm2, views, residual, p_real : arrays
        As of ``Droplets``; here ``views`` are those that support the droplet, each alone.
    diameters_raw_um : (N,) array
        As fitted to the images.
    diameters_um : (N,) array
        Corrected by a size calibration; without one, as fitted.
    diameter_sd_um : (N,) array
        Standard deviation, by the noise of the images.
    """

    points_mm: FloatArray
    covariance_mm2: FloatArray
    diameters_um: FloatArray
    diameters_raw_um: FloatArray
    diameter_sd_um: FloatArray
    views: NDArray[np.int64]
    residual: FloatArray
    p_real: FloatArray

    @property
    def sized(self) -> bool:
        """Whether they have diameters."""
        return True

    @classmethod
    def none(cls) -> "SizedDroplets":
        """No droplets."""
        empty = np.empty(0)
        return cls(np.empty((0, 3)), np.empty((0, 3, 3)), empty, empty, empty, np.empty(0, np.int64), empty, empty)

    def __len__(self) -> int:
        return len(self.diameters_um)

    def where(self, chosen: NDArray[np.bool_]) -> "SizedDroplets":
        """The chosen ones."""
        return _rows(self, chosen)

    def within(self, grid: VoxelGrid) -> "SizedDroplets":
        """Those in a grid, to half a voxel beyond its outermost centres, its own volume."""
        return _rows(self, grid.holds(self.points_mm))

    def unsure(self) -> "SizedDroplets":
        """The same, of none of which is told how probably it is real."""
        return replace(self, p_real=np.full(len(self), np.nan))

    def columns(self) -> Columns:
        """Columns by their names, as files have them."""
        return {
            **_places(self.points_mm),
            "diameter_um": self.diameters_um,
            "diameter_raw_um": self.diameters_raw_um,
            "diameter_sd_um": self.diameter_sd_um,
            **_sureness(self.p_real, self.views, self.residual, self.covariance_mm2),
        }


Table = TypeVar("Table", Droplets, SizedDroplets)


def _rows(table: Table, chosen: NDArray[np.bool_]) -> Table:
    return type(table)(**{field.name: getattr(table, field.name)[chosen] for field in fields(table)})


def _places(points_mm: FloatArray) -> Columns:
    return dict(zip(("x_mm", "y_mm", "z_mm"), points_mm.T, strict=True))


def _sureness(
    p_real: FloatArray, views: NDArray[np.int64], residual: FloatArray, covariance_mm2: FloatArray
) -> Columns:
    covariances = {
        f"cov_{pair}_mm2": covariance_mm2[:, "xyz".index(pair[0]), "xyz".index(pair[1])] for pair in COVARIANCES
    }
    return {"p_real": p_real, "views": views, "residual": residual, **covariances}
