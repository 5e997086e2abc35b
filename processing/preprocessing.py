"""From raw exposures to the shadow intensities that reconstruction takes.

Shadowgraphs are divided by their background, inverted, and freed of what varies slowly by subtracting a
sliding minimum (paper, section "Volumetric camera calibration and intensity reconstruction"). Images of
bright particles on black are inverted already.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.kernels import DEFAULT_THREADS, _native

Polarity = Literal["shadow", "bright"]
Intensity = NDArray[np.float32]
Frame = NDArray[np.uint8] | NDArray[np.uint16]

FIELD_WINDOW_PX = 201
"""Over which the light field is estimated where the settings state no window."""
LEAST_LIGHT, MOST_LIGHT = 1 / 64, 0.98
"""Of the full scale: a background that is darker or brighter tells no transmission."""
LEAST_PATTERN = 0.005
"""Of the light: pixels of a mosaic whose levels differ by less are left as they are; of grey images it is 0.0002."""
DIM = 1 / 8
"""Of the full scale: a frame without a brighter pixel is dim."""


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
    frame: Frame,
    settings: Preprocessing,
    *,
    bits: int,
    dark: Intensity | None = None,
    background: Intensity | None = None,
    out: Intensity | None = None,
    threads: int = DEFAULT_THREADS,
) -> Intensity:
    """Droplet intensity of one exposure.

    Parameters
    ----------
    frame : (rows, columns) uint8 or uint16 array
        Grey values.
    settings : Preprocessing
        Polarity, sliding minimum and noise floor.
    bits : int
        Significant bits of a grey value.
    dark, background : (rows, columns) float32 array, optional
        Mean image without light, and with light but without spray, of the same exposure (A or B). Without
        a background the light field is estimated from the frame itself. Where the background has less than a
        thousandth of the full scale, nobody knows what was in the way: 0.
    out : (rows, columns) float32 array, optional
        Receives the intensities; reused memory is faster than new.
    threads : int
        The result does not depend on it.

    Returns
    -------
    (rows, columns) float32 array
        0 where the view is free, 1 where it is blocked; ``out`` where given.

    Raises
    ------
    ValueError
        A reference image or ``out`` has another shape than the frame, or an array another type than stated.
    """
    for name, reference in (("dark", dark), ("background", background), ("output", out)):
        if reference is not None and reference.shape != frame.shape:
            raise ValueError(f"{name} image {reference.shape} does not fit the frame {frame.shape}")
    if settings.polarity not in get_args(Polarity):
        raise ValueError(f"polarity {settings.polarity!r}: {' or '.join(get_args(Polarity))}, please")
    if frame.ndim != 2:
        raise ValueError(f"a frame is (rows, columns), not {frame.shape}: colour images must be made grey first")
    if frame.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"a frame has grey values of uint8 or uint16, not {frame.dtype}")
    result = _result(frame.shape, out)
    if settings.polarity == "shadow" and background is None:
        background = _estimated_background(frame, dark, settings.minimum_window_px or FIELD_WINDOW_PX, threads)
    _native.preprocess(
        frame if frame.flags.c_contiguous else frame.copy(),
        dark,
        background if settings.polarity == "shadow" else None,
        2**bits - 1,
        settings.minimum_window_px,
        settings.noise_floor,
        result,
        threads,
    )
    return result


def transmission(
    grey: Intensity, dark: Intensity | np.float32, background: Intensity, *, bits: int
) -> tuple[Intensity, Intensity]:
    """Light of an exposure over that of its background, and how sure each pixel is.

    Parameters
    ----------
    grey : (rows, columns) float32 array
        Grey values of the exposure.
    dark, background : (rows, columns) float32 arrays
        Mean image without light, which may be one number, and with light but without spray.
    bits : int
        Significant bits of a grey value.

    Returns
    -------
    (rows, columns) float32 array
        1 where nothing is in the way of light; not clipped.
    (rows, columns) float32 array
        Inverse variance relative to a typical pixel, as of counted light; 0 where the background is
        dark or saturated, where the image is 1.

    Notes
    -----
    A mosaic of colours that the background does not show is divided out, too: see ``without_mosaic``.
    """
    light, known = background - dark, known_light(background, dark, bits=bits)
    sure = np.where(known, light, np.float32(0))
    if known.any():
        sure /= np.median(sure[known])
    image = np.where(known, (grey - dark) / np.where(known, light, np.float32(1)), np.float32(1))
    return without_mosaic(image.astype(np.float32), known), sure.astype(np.float32)


def without_mosaic(image: Intensity, known: NDArray[np.bool_]) -> Intensity:
    """Transmissions without the pattern of a mosaic, two by two pixels, by which some get less light than others.

    So it is left where raw values behind a mosaic of colours are divided by a background that was made grey, or the
    other way round. Droplets darken neighbours alike, so that ratios of pixels to their neighbours tell it.

    Parameters
    ----------
    image : (rows, columns) float32 array
        Transmissions.
    known : (rows, columns) bool array
        Pixels that count.

    Returns
    -------
    (rows, columns) float32 array
        With the mean of four neighbours as before; the same image where none differ.
    """
    rows, columns = (2 * (side // 2) for side in image.shape)
    blocks = image[:rows, :columns].reshape(rows // 2, 2, columns // 2, 2)
    whole = known[:rows, :columns].reshape(blocks.shape).all(axis=(1, 3)) & (blocks.mean(axis=(1, 3)) > LEAST_LIGHT)
    if not whole.any():
        return image
    four = blocks.transpose(0, 2, 1, 3)[whole]
    levels = np.median(four / four.mean(axis=(1, 2), keepdims=True), axis=0)
    levels /= levels.mean()
    if np.ptp(levels) < LEAST_PATTERN or levels.min() <= 0:
        return image
    pattern = np.tile(levels, (rows // 2 + 1, columns // 2 + 1))[: image.shape[0], : image.shape[1]]
    return np.where(known, image / pattern, image).astype(np.float32)


def known_light(background: Intensity, dark: Intensity | np.float32, *, bits: int) -> NDArray[np.bool_]:
    """Of which pixels a background tells the light, (rows, columns): it is neither dark there nor saturated.

    Parameters
    ----------
    background, dark, bits
        As of ``transmission``.
    """
    full_scale = np.float32(2**bits - 1)
    return (background - dark >= LEAST_LIGHT * full_scale) & (background <= MOST_LIGHT * full_scale)


def is_dim(frame: Frame, bits: int) -> bool:
    """Whether no grey value of that many significant bits is above 1/8 of the full scale."""
    return bool(frame.max() < DIM * (2**bits - 1))


def sliding_minimum(
    image: Intensity, window_px: int, out: Intensity | None = None, *, threads: int = DEFAULT_THREADS
) -> Intensity:
    """Smallest value in a square window around each pixel, averaged over the same window.

    Beyond its edges an image continues as it ends. Its cost hardly depends on the window.

    Parameters
    ----------
    image : (rows, columns) float32 array
        Of any unit.
    window_px : int
        Edge of the window, from 1 on.
    out : (rows, columns) float32 array, optional
        Receives the minima; reused memory is faster than new.
    threads : int
        The result does not depend on it.

    Returns
    -------
    (rows, columns) float32 array
        In the unit of the image; ``out`` where given.
    """
    result = _result(image.shape, out)
    _native.sliding_minimum(np.ascontiguousarray(image, dtype=np.float32), window_px, result, threads)
    return result


def _estimated_background(frame: Frame, dark: Intensity | None, window_px: int, threads: int) -> Intensity:
    """What the frame would be without droplets: its sliding maximum, once single bright pixels are gone."""
    light = frame.astype(np.float32) - (0 if dark is None else dark)
    smooth = np.asarray(cv2.medianBlur(light, 5), dtype=np.float32)
    background: Intensity = (0 if dark is None else dark) - sliding_minimum(-smooth, window_px, threads=threads)
    return background


def _result(shape: tuple[int, ...], out: Intensity | None) -> Intensity:
    if out is None:
        return np.empty(shape, np.float32)
    if out.dtype != np.float32 or not out.flags.c_contiguous:
        raise ValueError(f"output must be contiguous float32, not {out.dtype} with strides {out.strides}")
    return out
