"""Where the droplets of a shot are seen: bright round spots of a preprocessed image, with sub-pixel positions."""

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.geometry import FloatArray

SMOOTHING_PX = 1.0
"""Blur against pixel noise; it leaves one maximum per droplet."""
MIN_INTENSITY = 0.05
"""Fainter spots are noise; intensity is 0 where the view is free, 1 where it is blocked."""
MAX_SIGMA_PX = 4.0
"""Wider spots are liquid sheets, ligaments and clusters: their middle is not that of a droplet."""
MAX_ELONGATION = 1.6
"""Ratio of the widths along columns and rows; longer spots are two droplets, or none."""
_BORDER_PX = 3
_NEIGHBOURS = np.array([-1, 0, 1])


def find_droplets(image: NDArray[np.float32]) -> FloatArray:
    """Centres of the droplets in an image.

    Each is the middle of a Gaussian through the highest pixel of a spot and its neighbours, along the row and
    along the column.

    Parameters
    ----------
    image : (rows, columns) array
        Droplet intensity, bright on black.

    Returns
    -------
    (N, 2) array
        (u, v) in px, brightest first.
    """
    smooth: NDArray[np.float32] = np.asarray(
        cv2.GaussianBlur(np.asarray(image, np.float32), (0, 0), SMOOTHING_PX), np.float32
    )
    highest = cv2.dilate(smooth, np.ones((3, 3), np.uint8))
    peaks = (smooth == highest) & (smooth > MIN_INTENSITY)
    border = np.zeros_like(peaks)
    border[_BORDER_PX:-_BORDER_PX, _BORDER_PX:-_BORDER_PX] = True
    rows, columns = np.nonzero(peaks & border)
    shift_u, sigma_u = _gaussian(smooth[rows[:, None], columns[:, None] + _NEIGHBOURS])
    shift_v, sigma_v = _gaussian(smooth[rows[:, None] + _NEIGHBOURS, columns[:, None]])
    wide, narrow = np.maximum(sigma_u, sigma_v), np.minimum(sigma_u, sigma_v)
    round_ = (wide < MAX_SIGMA_PX) & (wide < MAX_ELONGATION * narrow)
    round_ &= (np.abs(shift_u) <= 1) & (np.abs(shift_v) <= 1)
    order = np.argsort(-smooth[rows, columns][round_], kind="stable")
    return np.column_stack([columns + shift_u, rows + shift_v])[round_][order].astype(np.float64)


def _gaussian(values: NDArray[np.float32]) -> tuple[FloatArray, FloatArray]:
    """Middle, from the middle pixel, and standard deviation of Gaussians through three neighbouring pixels (N, 3)."""
    low, mid, high = np.log(np.maximum(values.astype(np.float64), 1e-6)).T
    curvature = np.maximum(2 * mid - low - high, 1e-9)
    return 0.5 * (high - low) / curvature, 1 / np.sqrt(curvature)
