"""How noisy an image is, by itself."""

import numpy as np
from numpy.typing import NDArray

LEAST_NOISE = 1e-3
"""Of the brightest pixels: no camera is better."""


def noise_of(image: NDArray[np.float32], known: NDArray[np.bool_] | None = None) -> float:
    """Standard deviation of the noise of single pixels.

    It is the median absolute value of a mixed second difference, which what is smooth hardly feels.

    Parameters
    ----------
    image : (rows, columns) array
        Of any unit.
    known : (rows, columns) bool array, optional
        Pixels that count; by default all.
    """
    along_rows = image[1:-1] - 0.5 * (image[:-2] + image[2:])
    mixed = along_rows[:, 1:-1] - 0.5 * (along_rows[:, :-2] + along_rows[:, 2:])
    if known is not None and known.any():
        mixed, image = mixed[known[1:-1, 1:-1]], image[known]
    brightest = float(np.quantile(image, 0.999) - np.quantile(image, 0.01)) or float(np.ptp(image))
    return max(float(np.median(np.abs(mixed))) / 0.6745 / 1.5, LEAST_NOISE * brightest)
