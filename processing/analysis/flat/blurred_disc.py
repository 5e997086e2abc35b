"""What blur does to the outline of an opaque disc, and how to take it back.

A disc of radius R blurred by a Gaussian of standard deviation s R has the profile of a non-central chi-square
distribution: ``1 - Q1(r / s, 1 / s)`` with Marcum's Q. Its outline at half of its own depth is not at R: it shrinks by
``s^2 / 2`` while the middle stays dark, and grows when that fades. Outlines at a quarter and three quarters tell s.
"""

from functools import lru_cache

import numpy as np
from scipy.special import chndtr

from processing.geometry import FloatArray

LEVELS = (0.25, 0.5, 0.75)
"""Of the depth of a droplet, from outside."""
MOST_BLUR = 0.8
"""Of the radius: from there on all outlines are those of the blur, and the size is unknown."""


def unblurred(radii_px: tuple[float, float, float]) -> tuple[float, float]:
    """Radius of a disc, and the blur.

    Parameters
    ----------
    radii_px : 3 floats
        Radii of circles as large as the outlines at ``LEVELS``.

    Returns
    -------
    radius_px, blur_px : float
        Of the disc, and standard deviation of the blur; the blur is ``MOST_BLUR`` radii where it cannot be told.
    """
    outer_px, middle_px, inner_px = radii_px
    blurs, widths, middles = _table()
    blur = float(np.interp((outer_px - inner_px) / middle_px, widths, blurs))
    radius_px = middle_px / float(np.interp(blur, blurs, middles))
    return radius_px, blur * radius_px


def flattening(radius_px: float, blur_px: float) -> float:
    """Mean of the 3 x 3 pixels in the middle of a blurred disc, over its middle: 1 but for small ones."""
    if blur_px <= 0:
        return 1.0
    middle, beside, corner = profile(np.array([0.0, 1.0, np.sqrt(2)]), radius_px, blur_px).tolist()
    return float((middle + 4 * beside + 4 * corner) / (9 * middle))


@lru_cache(maxsize=1)
def _table() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Blur over radius; width of the edge over the half radius; half radius over the true one."""
    blurs = np.concatenate([[0.0], np.linspace(0.02, MOST_BLUR, 40)])
    radii = np.linspace(0, 3, 601)
    outlines = np.array([(1.0, 1.0, 1.0), *(_outlines(blur, radii) for blur in blurs[1:])])
    return blurs, (outlines[:, 0] - outlines[:, 2]) / outlines[:, 1], outlines[:, 1]


def _outlines(blur: float, radii: FloatArray) -> tuple[float, ...]:
    dark = profile(radii, 1.0, blur)
    dark /= dark[0]
    return tuple(float(np.interp(-level, -dark, radii)) for level in LEVELS)


def profile(distances: FloatArray, radius: float, blur: float) -> FloatArray:
    """Darkness of a blurred disc at distances from its centre."""
    return np.asarray(chndtr((radius / blur) ** 2, 2, np.maximum(distances, 1e-9) ** 2 / blur**2))
