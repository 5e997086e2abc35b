"""Opaque discs in partially coherent light, in units of the blur, as functions of radius and distance.

Abbe's sum (``processing.coherent_light``) is computed for some diameters and interpolated. Small discs darken by their
area alone; the edges of large ones all look alike. Diffraction makes nearly all of the blur in focus, the rest is taken
as a Gaussian: the area of the pixel, and defocus.
"""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import j1

from processing.coherent_light import CORE_SIGMA, blurred, circles, waves
from processing.geometry import FloatArray

CORE_SHARE = 0.94
"""Of the blur that is diffraction: of lenses whose Airy disk is four to five pixels."""
BLURS_PER_AIRY = CORE_SHARE / CORE_SIGMA
SMALLEST_AIRY, LARGEST_AIRY = 0.08, 5.0
"""Between these diameters discs are computed."""
DIAMETERS = 48
FINE_AIRY = 0.02
"""Step of the distances that are computed."""


def coherent_discs(
    condenser_ratio: float, radii: FloatArray, distances: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Share of the light that discs take, minus its change with distance over distance, its change with radius squared.

    Parameters
    ----------
    condenser_ratio : float
        Numerical aperture of the light over that of the lens.
    radii, distances : (R,), (R, D) arrays
        In blurs; a row of distances for each radius.
    """
    reach_airy = 0.5 * LARGEST_AIRY + float((distances[:, -1] - radii).max()) / BLURS_PER_AIRY
    grid = _Grid(condenser_ratio, np.arange(0, reach_airy + 2 * FINE_AIRY, FINE_AIRY))
    rows = [grid.disc(radius, row) for radius, row in zip(radii.tolist(), distances, strict=True)]
    taken, pull, growth = (np.array(column) for column in zip(*rows, strict=True))
    return taken, pull, growth


class _Grid:
    """What discs of some diameters take at some distances, interpolated."""

    def __init__(self, condenser_ratio: float, distances_airy: FloatArray) -> None:
        rings, diameters = circles(), np.geomspace(SMALLEST_AIRY, LARGEST_AIRY, DIAMETERS)
        spectra = np.array([rings.spectrum(diameter, condenser_ratio) for diameter in diameters])
        spectra *= -blurred(rings.per_airy, CORE_SIGMA * np.sqrt(CORE_SHARE**-2 - 1))
        turns = 2 * np.pi * rings.per_airy[:, None]
        self._distances = distances_airy
        self._taken = CubicSpline(np.log(diameters), spectra @ waves(rings.per_airy, distances_airy))
        self._slope = CubicSpline(np.log(diameters), spectra @ (-turns * j1(turns * distances_airy)))

    def disc(self, radius: float, distances: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """One disc at some distances, in blurs."""
        wanted_airy = 2 * radius / BLURS_PER_AIRY
        diameter_airy = float(np.clip(wanted_airy, SMALLEST_AIRY, LARGEST_AIRY))
        at, beyond = np.log(diameter_airy), max(radius - 0.5 * diameter_airy * BLURS_PER_AIRY, 0.0)
        places = np.abs(distances - beyond) / BLURS_PER_AIRY
        taken, slope, grown = (
            self._at(values, places)
            for values in (self._taken(at), self._slope(at) / BLURS_PER_AIRY, self._taken(at, 1) / radius)
        )
        faint = min(wanted_airy / SMALLEST_AIRY, 1.0) ** 2
        growth = -slope if beyond else grown if faint == 1 else 2 * faint * taken / radius
        pull = -faint * slope / np.where(distances > 0, distances, np.inf)
        pull[distances == 0] = pull[1]
        return faint * taken, pull, growth / (2 * radius)

    def _at(self, values: FloatArray, places_airy: FloatArray) -> FloatArray:
        return np.asarray(CubicSpline(self._distances, values)(places_airy), dtype=np.float64)
