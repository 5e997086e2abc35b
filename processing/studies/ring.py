"""A ring in a slice: its profile over the radius, how high and wide it is, how steep its flanks are."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from processing.geometry import FloatArray

Slice = NDArray[np.floating]

SMOOTHING_MM = 0.05
"""Sigma of the smoothing of gradients: without it, single droplets of a mean are steeper than the ring."""


@dataclass(frozen=True, eq=False)
class RadialProfile:
    """Mean intensity over the azimuth, relative to the mean over the circle.

    So every method is taken to have placed the same liquid: what it spreads elsewhere is missing in the ring.

    Parameters
    ----------
    radii_mm : (N,) array
        Middle of each bin, equally spaced.
    intensities : (N,) array
        1 everywhere where liquid is spread evenly.
    """

    radii_mm: FloatArray
    intensities: FloatArray

    @property
    def ring_mm(self) -> float:
        """Radius of the maximum."""
        return float(self.radii_mm[np.argmax(self.intensities)])

    @property
    def gradients_per_mm(self) -> FloatArray:
        """Slope of the relative intensity over the radius, (N,), smoothed by a Gaussian of ``SMOOTHING_MM``."""
        bin_mm = self.radii_mm[1] - self.radii_mm[0]
        slope = gaussian_filter1d(self.intensities, SMOOTHING_MM / bin_mm, order=1, mode="nearest")
        return np.asarray(slope / bin_mm, dtype=np.float64)

    @property
    def inner_gradient_per_mm(self) -> float:
        """Steepest rise inside of the ring, from half its radius on: the few voxels in the middle are noisy."""
        peak = int(np.argmax(self.intensities))
        return float(self.gradients_per_mm[peak // 2 : peak + 1].max())

    @property
    def outer_gradient_per_mm(self) -> float:
        """Steepest fall outside of it, as a positive number."""
        return float(-self.gradients_per_mm[np.argmax(self.intensities) :].min())

    @property
    def width_mm(self) -> float:
        """Full width at half maximum, from the maximum to both sides."""
        peak = int(np.argmax(self.intensities))
        half = 0.5 * float(self.intensities[peak])
        inside = np.flatnonzero(self.intensities[:peak] < half)
        outside = np.flatnonzero(self.intensities[peak:] < half)
        first = self._crossing_mm(int(inside[-1]), half) if len(inside) else float(self.radii_mm[0])
        last = self._crossing_mm(peak + int(outside[0]) - 1, half) if len(outside) else float(self.radii_mm[-1])
        return last - first

    def _crossing_mm(self, before: int, level: float) -> float:
        """Radius at which the profile crosses a level between a bin and the next."""
        a, b = self.intensities[before : before + 2]
        share = (level - a) / (b - a)
        return float(self.radii_mm[before] + share * (self.radii_mm[before + 1] - self.radii_mm[before]))


def radial_profile(slice_zx: Slice, x_mm: FloatArray, z_mm: FloatArray, bin_mm: float) -> RadialProfile:
    """Profile of a slice around x = z = 0.

    Parameters
    ----------
    slice_zx : (nz, nx) array
        Intensities, not all zero.
    x_mm, z_mm : (nx,) and (nz,) array
        Where its voxels lie.
    bin_mm : float
        Width of a bin; the profile ends where the slice does.
    """
    radii_mm = np.hypot(x_mm[None, :], z_mm[:, None])
    bins = np.rint(radii_mm / bin_mm).astype(np.intp)
    last = int(min(np.abs(x_mm).max(), np.abs(z_mm).max()) / bin_mm)
    within = bins <= last
    sums = np.bincount(bins[within], weights=slice_zx[within].astype(np.float64), minlength=last + 1)
    means = sums / np.maximum(np.bincount(bins[within], minlength=last + 1), 1)
    return RadialProfile(bin_mm * np.arange(last + 1, dtype=np.float64), means / float(slice_zx[within].mean()))
