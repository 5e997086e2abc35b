"""Do droplets move while the light is on? Then shadows are smeared along one direction, which no light does.

Smearing by a variance along a direction adds half of it times the second derivative along that direction. A part of
that is blur like any other, and is found as such; the rest has the shapes ``d2/du2 - d2/dv2`` and ``2 d2/dudv`` of what
is seen, whatever the droplets.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]

MOST_WAY_PX = 1.5
"""In the middle one of the views. Simulated droplets at rest seem to move by 0.1 to 0.7 pixels, by 1.0 in light from
all directions. Those that move by 1.7 may look as in light of 0.8 apertures, and then seem to move by 2.2 to 2.4."""
SURE = 5.0
"""Standard deviations by which a way is longer than that."""
ALONG_A_LINE = 12.0
"""Square of a way at even speed over its variance."""


def smear_doubts(
    images: Sequence[Image], drawn: Sequence[Image], weights: Sequence[Image], condenser_ratio: float | None
) -> tuple[str, ...]:
    """What speaks against diameters in a light that shows; empty behind a Gaussian blur, which takes a little motion.

    Parameters
    ----------
    images, drawn : sequences of (rows, columns) arrays
        Transmissions as they were seen, one per view, and as discs at rest would show them.
    weights : sequence of (rows, columns) arrays
        One over the variance of a pixel; 0 where nothing is known.
    condenser_ratio : float | None
        Of the light that droplets were found in.
    """
    if condenser_ratio is None:
        return ()
    views = zip(images, drawn, weights, strict=True)
    sure, told = np.transpose([_variances_px2(image - at_rest, at_rest, weight) for image, at_rest, weight in views])
    if np.median(sure) <= MOST_WAY_PX**2 / ALONG_A_LINE:
        return ()
    return (
        f"droplets are smeared along one direction, as if they moved by {np.sqrt(ALONG_A_LINE * np.median(told)):.1f} "
        "px while the light is on: that looks like light from few directions, in which diameters may be 10 um too "
        "small; shorten the pulses, or state --light gaussian if the lens shows no diffraction",
    )


def _variances_px2(left: Image, drawn: Image, weight: Image) -> tuple[float, float]:
    """Of the smearing, in square pixels: that which is sure, and that which is likeliest; 0 where nothing tells."""
    by_v, by_u = np.gradient(drawn.astype(np.float64))
    (by_vv, by_uv), by_uu = np.gradient(by_v), np.gradient(by_u, axis=1)
    shapes = np.array([(by_uu - by_vv)[weight > 0], 2 * by_uv[weight > 0]])
    weighed = shapes * weight[weight > 0]
    squares = weighed @ shapes.T
    if np.linalg.matrix_rank(squares) < len(squares):
        return 0.0, 0.0
    variance = 4 * float(np.hypot(*np.linalg.solve(squares, weighed @ left[weight > 0].astype(np.float64))))
    sd = 4 * float(np.sqrt(np.trace(np.linalg.inv(squares)) / 2))
    return max(variance - SURE * sd, 0.0), variance
