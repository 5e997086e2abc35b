"""Pictures of frames and volumes, as PNG or JPEG bytes. Pure: arrays in, bytes out.

Contrast. A frame is stretched linearly from its 0.1 % to its 99.9 % quantile, so that a shadowgraph shows its full
range; but never over less than ``DIM`` of the bit depth, so that the noise of a dark frame stays dark. ``FULL`` shows
grey values as they are, black at 0 and white at the largest value of the bit depth. A volume is coloured from 0 to one
limit that is the same for all its slices, so that slices can be compared.
"""

from enum import StrEnum
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.preprocessing import DIM

Grey = NDArray[np.uint8]
_QUANTILES = (0.001, 0.999)
_JPEG_QUALITY = 82
_BRIGHTEST = {"blue": (255, 144, 64), "red": (64, 96, 255)}
"""Blue, green, red; the two together are a light violet."""


class Stretch(StrEnum):
    """How grey values become brightness."""

    AUTO = "auto"
    FULL = "full"


class Colours(StrEnum):
    """How an intensity becomes a colour: all of them begin with black."""

    HEAT = "heat"
    BLUE = "blue"
    """Of exposure A where both are shown, one upon the other."""
    RED = "red"
    """Of exposure B."""


_SHADES = {
    colours: np.rint(np.linspace((0, 0, 0), _BRIGHTEST[colours], 256)).astype(np.uint8)
    for colours in (Colours.BLUE, Colours.RED)
}


def frame_png(image: NDArray[Any], bits: int, stretch: Stretch = Stretch.AUTO, width_px: int | None = None) -> bytes:
    """PNG of a camera frame.

    Parameters
    ----------
    image : (rows, columns) array
        Grey values.
    bits : int
        Significant bits.
    stretch : Stretch
        See the module.
    width_px : int or None
        Width of the picture where it shall be smaller than the frame.
    """
    return _encode(".png", to_grey(_narrowed(image, width_px), bits, stretch))


def preview_jpeg(image: NDArray[Any], bits: int, stretch: Stretch, width_px: int) -> bytes:
    """Small JPEG of a camera frame for the live view, about 1 ms of work."""
    small = _narrowed_roughly(image, width_px) if image.shape[1] >= 2 * width_px else _narrowed(image, width_px)
    return _encode(".jpg", to_grey(small, bits, stretch), cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY)


def halved(image: NDArray[Any]) -> NDArray[Any]:
    """A frame at half its size, each pixel the mean of four."""
    rows, columns = image.shape
    size_px = (max(1, columns // 2), max(1, rows // 2))
    return np.asarray(cv2.resize(image, size_px, interpolation=cv2.INTER_AREA))


def square_at(image: NDArray[Any], row: int, column: int, size_px: int) -> NDArray[Any]:
    """A square part of a frame around a pixel; beyond the edge there are zeros."""
    square = np.zeros((size_px, size_px), image.dtype)
    (rows, to_rows), (columns, to_columns) = (
        _overlap(middle - size_px // 2, size_px, length)
        for middle, length in zip((row, column), image.shape, strict=True)
    )
    square[to_rows, to_columns] = image[rows, columns]
    return square


def to_grey(image: NDArray[Any], bits: int, stretch: Stretch) -> Grey:
    """Brightness 0 to 255 of grey values."""
    full = float(2**bits - 1)
    if stretch is Stretch.FULL:
        return np.asarray(cv2.convertScaleAbs(image, alpha=255 / full), np.uint8)
    low, high = _limits(image, full)
    scaled = (image.astype(np.float32) - low) * (255.0 / (high - low))
    grey: Grey = np.clip(np.rint(scaled), 0, 255).astype(np.uint8)
    return grey


def plane_png(plane: NDArray[Any], limit: float, colours: Colours = Colours.HEAT) -> bytes:
    """PNG of a plane of a volume, (rows, columns), coloured from 0 to ``limit``."""
    grey = np.clip(plane.astype(np.float32) * (255.0 / max(limit, 1e-9)), 0, 255).astype(np.uint8)
    if colours is Colours.HEAT:
        return _encode(".png", np.asarray(cv2.applyColorMap(grey, cv2.COLORMAP_INFERNO)))
    return _encode(".png", _SHADES[colours][grey])


def _overlap(first: int, size: int, length: int) -> tuple[slice, slice]:
    """Which part of a line is in a window that begins at ``first``, and where in the window that lies."""
    start, stop = min(max(first, 0), length), min(max(first + size, 0), length)
    return slice(start, stop), slice(start - first, stop - first)


def _limits(image: NDArray[Any], full: float) -> tuple[float, float]:
    """Grey values shown as black and white; the least range is as dark or bright as the frame is in the bit depth."""
    sample = image[::4, ::4] if image.size > 100_000 else image
    low, high = (float(limit) for limit in np.quantile(sample, _QUANTILES))
    missing = DIM * full - (high - low)
    if missing > 0:
        low -= missing * low / (full - (high - low))
        high = low + DIM * full
    return low, high


def _narrowed(image: NDArray[Any], width_px: int | None) -> NDArray[Any]:
    rows, columns = image.shape
    if width_px is None or width_px >= columns:
        return image
    size = (width_px, max(1, round(rows * width_px / columns)))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))


def _narrowed_roughly(image: NDArray[Any], width_px: int) -> NDArray[Any]:
    """The same by way of half the size, for a seventh of the work."""
    half = halved(image)
    size_px = (width_px, max(1, round(image.shape[0] * width_px / image.shape[1])))
    return np.asarray(cv2.resize(half, size_px, interpolation=cv2.INTER_LINEAR))


def _encode(suffix: str, pixels: NDArray[Any], *parameters: int) -> bytes:
    return cv2.imencode(suffix, pixels, parameters)[1].tobytes()
