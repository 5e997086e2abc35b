"""From raw exposures to the shadow intensities that reconstruction takes.

Shadowgraphs are divided by their background, inverted, and freed of what varies slowly by subtracting a
sliding minimum (paper, section "Volumetric camera calibration and intensity reconstruction"). Images of
bright particles on black are inverted already.
"""

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

Polarity = Literal["shadow", "bright"]
Intensity = NDArray[np.float32]

DARKEST_BACKGROUND = 1e-3
"""Share of the full scale below which a background pixel carries no light; its shadow is unknown, hence 0."""


@dataclass(frozen=True)
class Preprocessing:
    """How exposures become intensities.

    Parameters
    ----------
    polarity : {"shadow", "bright"}
        Dark droplets before a lit background, or bright particles on black.
    minimum_window_px : int
        Edge of the square window of the sliding minimum; larger than the largest structure; 0 leaves it out.
    noise_floor : float
        Intensity subtracted from every pixel, so that noise does not become droplets; in [0, 1).
    """

    polarity: Polarity = "shadow"
    minimum_window_px: int = 201
    noise_floor: float = 0.05


def intensity(
    frame: NDArray[np.uint8] | NDArray[np.uint16],
    settings: Preprocessing,
    *,
    bits: int,
    dark: Intensity | None = None,
    background: Intensity | None = None,
) -> Intensity:
    """Droplet intensity of one exposure.

    Parameters
    ----------
    frame : (rows, columns) array
        Grey values.
    settings : Preprocessing
        Polarity, sliding minimum and noise floor.
    bits : int
        Significant bits of a grey value.
    dark, background : (rows, columns) array, optional
        Mean image without light, and with light but without spray, of the same exposure (A or B). Without
        a background the light field is estimated from the frame itself.

    Returns
    -------
    (rows, columns) float32 array
        0 where the view is free, 1 where it is blocked.

    Raises
    ------
    ValueError
        A reference image has another shape than the frame.
    """
    for name, reference in (("dark", dark), ("background", background)):
        if reference is not None and reference.shape != frame.shape:
            raise ValueError(f"{name} image {reference.shape} does not fit the frame {frame.shape}")
    full_scale = np.float32(2**bits - 1)
    light = (frame.astype(np.float32) - (0 if dark is None else dark)) / full_scale
    if settings.polarity == "shadow":
        light = opacity(light, _light_field(light, dark, background, full_scale, settings.minimum_window_px))
    if settings.minimum_window_px:
        light = light - sliding_minimum(light, settings.minimum_window_px)
    above_noise: Intensity = np.clip((light - settings.noise_floor) / (1 - settings.noise_floor), 0, 1)
    return above_noise


def opacity(light: Intensity, light_field: Intensity) -> Intensity:
    """Share of the light that a pixel lost, 1 - I / I0; 0 where the field itself is dark."""
    lit = light_field > DARKEST_BACKGROUND
    transmittance = np.divide(light, light_field, out=np.ones_like(light), where=lit)
    lost: Intensity = np.clip(1 - transmittance, 0, 1)
    return lost


def sliding_minimum(image: Intensity, window_px: int) -> Intensity:
    """Smallest value in a square window around each pixel, smoothed over the window."""
    kernel = cv2.getStructuringElement(cv2.MORPH_RECT, (window_px, window_px))
    eroded = cv2.erode(image, kernel, borderType=cv2.BORDER_REPLICATE)
    smoothed: Intensity = np.asarray(cv2.blur(eroded, (window_px, window_px), borderType=cv2.BORDER_REPLICATE))
    return smoothed


def _light_field(
    light: Intensity, dark: Intensity | None, background: Intensity | None, full_scale: np.float32, window_px: int
) -> Intensity:
    if background is not None:
        return (background - (0 if dark is None else dark)) / full_scale
    smooth: Intensity = np.asarray(cv2.medianBlur(light, 5))
    return -sliding_minimum(-smooth, window_px or 201)
