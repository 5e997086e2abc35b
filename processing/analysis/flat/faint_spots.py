"""Spots that stand out of the noise of an image, and are too faint to be told as droplets.

They are small droplets that blur or light has made pale, droplets far out of focus, dim particles, or dust.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.analysis.flat.darkness import Image
from processing.geometry import FloatArray

FAINTEST = 0.25
"""Of the depth that a droplet stands out by: fainter ones are the unevenness of a light."""
NOISES = 6.0
"""Standard deviations of the noise where nothing is seen."""
NOISE_PX = 31
"""Rows and columns that tell it: a light that falls off changes little in them."""
HALO_PX = 5
"""Beside a spot that is seen: its tail and its fringes."""
LEVEL = 0.25
"""Of the lesser side of an image: the light around a spot is the mean of so much; what is half as wide is light."""


def faint_diameters(values: Image, smoothed: Image, least: float) -> FloatArray:
    """About how large faint spots are.

    Parameters
    ----------
    values : (rows, columns) float32 array
        Darkness.
    smoothed : (rows, columns) float32 array
        The same, mean of 3 x 3, in which spots were looked for.
    least : float
        Of ``smoothed``, by which a spot stands out that is told.

    Returns
    -------
    (N,) array
        Diameters in px of circles as large as what is above half of the height of each; none at the border.
    """
    free = ~_seen(smoothed, least)
    even = np.asarray(cv2.GaussianBlur(_without_single_pixels(values), (0, 0), 1.0), np.float32)
    raised = even - _around(even, free, max(int(LEVEL * min(values.shape)), 3))
    height = np.maximum(FAINTEST * least, NOISES * _noise(raised, values - even, free))
    count, labels, boxes, _ = cv2.connectedComponentsWithStats((raised > 0.5 * height).astype(np.uint8))
    faint = _holding(labels, raised > height, count) & ~_holding(labels, ~free, count) & _spots(boxes, values.shape)
    sizes_px = [_diameter_px(raised, labels, boxes, int(label)) for label in np.flatnonzero(faint)]
    return np.array(sizes_px, np.float64)


def _without_single_pixels(values: Image) -> Image:
    """None is above all of its neighbours: what lights or fails alone is the camera's."""
    around = np.ones((3, 3), np.uint8)
    around[1, 1] = 0
    return np.asarray(np.minimum(values, cv2.dilate(values, around)), np.float32)


def _noise(raised: Image, rough: Image, free: NDArray[np.bool_]) -> Image:
    """Of smoothed values, which is more where single pixels have more: faint spots are not among what these have."""
    some = free[::2, ::2]
    if not some.any():
        return np.full_like(raised, np.inf)
    around = _around(np.abs(rough), free, NOISE_PX)
    uneven = around / max(float(np.median(around[::2, ::2][some])), 1e-6)
    return np.asarray(1.4826 * float(np.median(np.abs(raised[::2, ::2][some]))) * np.maximum(uneven, 1), np.float32)


def _seen(smoothed: Image, least: float) -> NDArray[np.bool_]:
    """Pixels of all that stands out, and of its halo."""
    count, labels, *_ = cv2.connectedComponentsWithStats((smoothed > 0.5 * least).astype(np.uint8))
    told = _holding(labels, smoothed >= least, count)
    square = np.ones((2 * HALO_PX + 1, 2 * HALO_PX + 1), np.uint8)
    return np.asarray(cv2.dilate(told[labels].astype(np.uint8), square) > 0)


def _holding(labels: NDArray[Any], pixels: NDArray[np.bool_], count: int) -> NDArray[np.bool_]:
    """Whether labels hold any of such pixels; 0 is none."""
    held = np.bincount(labels[pixels], minlength=count) > 0
    held[0] = False
    return np.asarray(held)


def _around(values: Image, free: NDArray[np.bool_], width: int) -> Image:
    """Mean of so many rows and columns around each pixel, where nothing is seen."""
    weights = free.astype(np.float32)
    mean = cv2.blur(values * weights, (width, width)) / np.maximum(cv2.blur(weights, (width, width)), 1e-3)
    return np.asarray(mean, np.float32)


def _spots(boxes: NDArray[Any], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Whether boxes lie within the image, and are no larger than spots that its light is told beside."""
    left, top, width, height, _ = boxes.T
    inside = (left > 0) & (top > 0) & (left + width < shape[1]) & (top + height < shape[0])
    return np.asarray(inside & (np.maximum(width, height) <= 0.5 * LEVEL * min(shape)))


def _diameter_px(raised: Image, labels: NDArray[Any], boxes: NDArray[Any], label: int) -> float:
    left, top, width, height, _ = (int(value) for value in boxes[label])
    part = (slice(top, top + height), slice(left, left + width))
    heights = np.where(labels[part] == label, raised[part], 0)
    return float(np.sqrt(4 / np.pi * np.count_nonzero(heights > 0.5 * heights.max())))
