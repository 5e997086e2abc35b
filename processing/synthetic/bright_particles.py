"""Images of bright particles on black: Gaussian spots where the camera itself sees them, added pixel by pixel."""

import numpy as np

from processing.geometry import FloatArray, ViewMapping

REACH_SIGMAS = 6.0
"""Beyond, a spot has less than 2e-8 of its height."""


def spots_image(mapping: ViewMapping, points_mm: FloatArray, heights: FloatArray, sigma_px: float) -> FloatArray:
    """What a view sees of particles, without noise.

    Parameters
    ----------
    mapping : ViewMapping
        Where the view sees points.
    points_mm : (N, 3) array
        The particles.
    heights : (N,) array
        Of their spots, which add up where they overlap.
    sigma_px : float
        Width of the spots.

    Returns
    -------
    (rows, columns) array
        In the unit of the heights.
    """
    width_px, height_px = mapping.image_size_px
    columns, rows = np.arange(width_px), np.arange(height_px)
    image = np.zeros((height_px, width_px))
    reach_px = REACH_SIGMAS * sigma_px
    for (u, v), height in zip(mapping.project(points_mm), heights, strict=True):
        across = slice(*np.searchsorted(columns, [u - reach_px, u + reach_px]))
        down = slice(*np.searchsorted(rows, [v - reach_px, v + reach_px]))
        along_u, along_v = ((places - at) / sigma_px for places, at in ((columns[across], u), (rows[down], v)))
        image[down, across] += height * np.exp(-0.5 * (along_v[:, None] ** 2 + along_u**2))
    return image
