"""What an opaque disc under a Gaussian blur looks like: the table that the kernels interpolate.

With radii and distances in units of the blur, a disc of radius rho takes ``q = P(rho, r)`` of the light at the distance
r from its centre: the share of a Gaussian around r that lies within rho of the centre. Its derivatives are closed
(``dq/drho = rho exp(-(rho - r)^2 / 2) I0e(rho r)``, and minus the same with I1e along r), q itself is their integral.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import i0e, i1e

from processing.geometry import FloatArray
from processing.kernels import _native

OPACITY = 0.999
"""Of a disc, so that a logarithm of what it lets through exists: a tenth of the noise of good images."""
BEYOND_NODES = 2
QUADRATURE_POINTS = 48


@cache
def disc_profiles() -> NDArray[np.float32]:
    """The table (rows, 3, nodes): binary logarithm of the transmission, pull and growth; see ``job.hpp``."""
    octaves = np.arange(_native.DISC_ROWS) / _native.DISC_ROWS_PER_OCTAVE
    radii = _native.SMALLEST_DISC * 2.0 ** octaves[:, None]
    inner = np.maximum(radii - _native.DISC_REACH, 0)
    inside = _native.DISC_NODES - BEYOND_NODES
    share = np.arange(inside) / inside
    distances = np.sqrt(inner**2 + share * ((radii + _native.DISC_REACH) ** 2 - inner**2))
    table = np.zeros((_native.DISC_ROWS, 3, _native.DISC_NODES), np.float32)
    table[:, :, :inside] = np.stack(_profile(radii, distances), axis=1)
    table.flags.writeable = False
    return table


def opacity(radii: FloatArray, distances: FloatArray) -> FloatArray:
    """Share q of the light that discs take, in units of the blur, by Gauss-Legendre quadrature over the radius."""
    nodes, weights = np.polynomial.legendre.leggauss(QUADRATURE_POINTS)
    radii, distances = np.broadcast_arrays(radii, distances)
    low = np.clip(distances - 9.0, 0, radii)
    half = 0.5 * (radii - low)
    within = (low + half)[..., None] + half[..., None] * nodes
    rings = within * np.exp(-0.5 * (within - distances[..., None]) ** 2) * i0e(within * distances[..., None])
    return np.minimum(half * (rings @ weights), 1.0)


def _profile(radii: FloatArray, distances: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    let_through = 1 - OPACITY * opacity(radii, distances)
    bell = OPACITY * np.exp(-0.5 * (radii - distances) ** 2) / let_through
    product = radii * distances
    ratio = np.where(product > 0, i1e(product) / np.where(product > 0, product, 1), 0.5)
    return np.log2(let_through), bell * radii**2 * ratio, -0.5 * bell * i0e(product)
