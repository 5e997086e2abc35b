"""Preprocessing as one would write it with numpy and OpenCV: what the kernels are held against."""

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.preprocessing import Preprocessing

Image = NDArray[np.float64]


def intensity(
    frame: NDArray[np.uint8] | NDArray[np.uint16],
    settings: Preprocessing,
    *,
    bits: int,
    dark: NDArray[np.float32] | None,
    background: NDArray[np.float32] | None,
) -> Image:
    """Intensities of a frame, in double precision."""
    full_scale, dark_level = 2**bits - 1, 0.0 if dark is None else dark.astype(float)
    light = (frame - dark_level) / full_scale
    if settings.polarity == "shadow":
        light = opacity(light, light_field(light, background, dark_level, full_scale, settings.minimum_window_px))
    if settings.minimum_window_px:
        light = light - sliding_minimum(light, settings.minimum_window_px)
    return np.asarray(np.clip((light - settings.noise_floor) / (1 - settings.noise_floor), 0, 1))


def opacity(light: Image, field: Image) -> Image:
    """Share of the light that is lost; nothing where there is none."""
    transmittance = np.divide(light, field, out=np.ones_like(light), where=field > 1e-3)
    return np.asarray(np.clip(1 - transmittance, 0, 1))


def light_field(
    light: Image, background: NDArray[np.float32] | None, dark_level: Image | float, full_scale: int, window_px: int
) -> Image:
    """The light without droplets, from the background or from the image itself."""
    if background is not None:
        return np.asarray((background - dark_level) / full_scale)
    smooth = cv2.medianBlur(light.astype(np.float32), 5).astype(float)
    return -sliding_minimum(-smooth, window_px or 201)


def sliding_minimum(image: Image, window_px: int) -> Image:
    """Erosion and mean over a square; beyond its edges the image continues as it ends."""
    kernel = cv2.getStructuringElement(cv2.MORPH_RECT, (window_px, window_px))
    eroded = cv2.erode(image, kernel, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(cv2.blur(eroded, (window_px, window_px), borderType=cv2.BORDER_REPLICATE))
