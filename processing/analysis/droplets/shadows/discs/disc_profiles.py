"""What an opaque disc looks like: the tables that the kernels interpolate, one for each kind of light.

Radii and distances are in units of the blur. In incoherent light a disc of radius rho takes ``q = P(rho, r)`` of the
light at the distance r from its centre, the share of a Gaussian around r that lies within rho of the centre. Its
derivatives are closed (``dq/drho = rho exp(-(rho - r)^2 / 2) I0e(rho r)``, and minus the same with I1e along r), q
itself is their integral. In partially coherent light they are Abbe's (``coherent_discs``).
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import i0e, i1e

from processing.analysis.droplets.shadows.discs.coherent_discs import coherent_discs
from processing.geometry import FloatArray
from processing.kernels import _native

OPACITY = 0.999
"""Of a disc, so that a logarithm of what it lets through exists: a tenth of the noise of good images."""
REACH, COHERENT_REACH = 3.2, 5.0
"""Beyond the edge of a disc nothing is left of it: of its blur, and of the fringes of coherent light."""
DARKEST = 1e-3
"""Transmission that has a logarithm."""
BEYOND_NODES = 2
EDGE_ROW = 130
"""A disc of 14 blurs."""
QUADRATURE_POINTS = 48


@dataclass(frozen=True, eq=False)
class DiscProfiles:
    """Profiles of discs of all sizes in one light.

    Parameters
    ----------
    table : (rows, 3, nodes) float32 array
        Binary logarithm of the transmission, pull and growth; see ``job.hpp``.
    reach : float
        How far a profile goes beyond the edge of its disc, in blurs.
    """

    table: NDArray[np.float32]
    reach: float

    @property
    def edge(self) -> tuple[float, float]:
        """Of large discs, in blurs: how far beyond the edge half of the light is let through, and how blurred it looks.

        A Gaussian blur of that width has the same slope there.
        """
        light = np.exp2(self.table[EDGE_ROW, 0, :-BEYOND_NODES].astype(np.float64))
        radius = _native.SMALLEST_DISC * 2.0 ** (EDGE_ROW / _native.DISC_ROWS_PER_OCTAVE)
        distances = _distances(np.array([[radius]]), self.reach)[0]
        at = int(np.searchsorted(np.maximum.accumulate(light), 0.5))
        slope = (light[at] - light[at - 1]) / (distances[at] - distances[at - 1])
        return float(distances[at] - (light[at] - 0.5) / slope - radius), float(1 / (np.sqrt(2 * np.pi) * slope))

    def transmission(self, radius: float, distances: FloatArray) -> FloatArray:
        """Light (N,) that one disc lets through, in units of the blur; edges of those beyond the table look alike.

        Parameters
        ----------
        radius : float
            Of the disc.
        distances : (N,) array
            From its centre.
        """
        held = float(np.clip(radius, _native.SMALLEST_DISC, _native.LARGEST_DISC))
        row = min(_native.DISC_ROWS_PER_OCTAVE * np.log2(held / _native.SMALLEST_DISC), _native.DISC_ROWS - 1.001)
        first, share = int(row), row - int(row)
        inner, outer = max(held - self.reach, 0), held + self.reach
        places = np.maximum(distances - (radius - held), 0) ** 2 - inner**2
        nodes = places / (outer**2 - inner**2) * (_native.DISC_NODES - BEYOND_NODES)
        below, above = (np.interp(nodes, np.arange(_native.DISC_NODES), self.table[at, 0]) for at in (first, first + 1))
        return np.asarray(np.exp2((1 - share) * below + share * above), dtype=np.float64)


@cache
def disc_profiles(condenser_ratio: float | None = None) -> DiscProfiles:
    """Profiles in the light of a condenser; kept, as those of coherent light cost half a second.

    Parameters
    ----------
    condenser_ratio : float, optional
        Numerical aperture of the light over that of the lens; without it light is incoherent.
    """
    reach = REACH if condenser_ratio is None else COHERENT_REACH
    octaves = np.arange(_native.DISC_ROWS) / _native.DISC_ROWS_PER_OCTAVE
    radii = _native.SMALLEST_DISC * 2.0 ** octaves[:, None]
    distances = _distances(radii, reach)
    profile = (
        _incoherent(radii, distances)
        if condenser_ratio is None
        else coherent_discs(condenser_ratio, radii[:, 0], distances)
    )
    table = np.zeros((_native.DISC_ROWS, 3, _native.DISC_NODES), np.float32)
    table[:, :, :-BEYOND_NODES] = np.stack(_rows(*profile), axis=1)
    table.flags.writeable = False
    return DiscProfiles(table, reach)


def _distances(radii: FloatArray, reach: float) -> FloatArray:
    """Nodes of the rows of a table, by radii (rows, 1), without those beyond."""
    inner, inside = np.maximum(radii - reach, 0), _native.DISC_NODES - BEYOND_NODES
    return np.asarray(np.sqrt(inner**2 + np.arange(inside) / inside * ((radii + reach) ** 2 - inner**2)))


def opacity(radii: FloatArray, distances: FloatArray) -> FloatArray:
    """Share q of the light that discs take, in units of the blur, by Gauss-Legendre quadrature over the radius."""
    nodes, weights = np.polynomial.legendre.leggauss(QUADRATURE_POINTS)
    radii, distances = np.broadcast_arrays(radii, distances)
    low = np.clip(distances - 9.0, 0, radii)
    half = 0.5 * (radii - low)
    within = (low + half)[..., None] + half[..., None] * nodes
    rings = within * np.exp(-0.5 * (within - distances[..., None]) ** 2) * i0e(within * distances[..., None])
    return np.minimum(half * (rings @ weights), 1.0)


def _incoherent(radii: FloatArray, distances: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Share of the light that discs take, minus its change with distance over distance, and its change with rho^2."""
    bell, product = np.exp(-0.5 * (radii - distances) ** 2), radii * distances
    ratio = np.where(product > 0, i1e(product) / np.where(product > 0, product, 1), 0.5)
    return opacity(radii, distances), bell * radii**2 * ratio, 0.5 * bell * i0e(product)


def _rows(taken: FloatArray, pull: FloatArray, growth: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    let_through = np.maximum(1 - OPACITY * taken, DARKEST)
    return np.log2(let_through), OPACITY * pull / let_through, -OPACITY * growth / let_through
