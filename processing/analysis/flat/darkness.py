"""How dark a pixel is, relative to the light behind it: 0 where light is free, about 1 in a droplet."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.image_noise import noise_of
from processing.errors import BadInput
from processing.exchanged_light import better_background
from processing.interlaced import ALTERNATING, rows_alternate
from processing.preprocessing import Polarity

FITS = 6
"""How often the background is fitted again without what lies off it."""
OFF_SIGMAS = 2.5
LEAST_FRAME = 0.03
"""Of the light: a frame is brighter by more."""
MOST_WHITE = 0.05
"""Of a line within the frame."""
_GRID = 64
"""The background is fitted to about so many pixels along each side."""

LEAST_LIGHT = 5.0
"""Over the noise."""
BITS = range(8, 17)
FULL_SCALES, SATURATED_SHARE = {*(2**bits - 1 for bits in BITS), *((2**bits - 1) << (16 - bits) for bits in BITS)}, 0.01
"""Grey values where cameras of 8 to 16 bits end, also where files have their bits on top; so many pixels of a
background there are more than glare."""
Image = NDArray[np.float32]


MOST_UNEXPLAINED, UNEXPLAINED = 0.005, 0.3
"""Share of pixels, and by how much of the light: light that is brighter than the fit is no droplet."""
MOST_UNEVEN = 0.1
"""Of the light: a fit that leaves so much where no droplet is does not know it. 53 shadowgraphs of others: 0.06."""
LEAST_SHARE = 0.5
"""Of the light that was given, which the brightest pixels of an image have: hardly a spray covers all of a view."""


MOST_HELD, LEAST_LIT = 0.2, 0.1
"""Of the light beside droplets: a background that lacks so much where they are holds them (three tenths make discs of
14 px 2 % too small, half 4 %); and what a background has at least where it is no silhouette, as a nozzle is."""
FEWEST_EDGES, LEAST_BETWEEN, LARGEST_SPOT = 50, 0.1, 0.02
"""Pixels along edges of dark spots that tell whether a threshold made them; pixels between dark and light beside each:
0.36 or more of sharp discs, 0.2 once contrast was doubled, 0 to 0.07 of two grey values through JPEG or with noise; and
share of the image of the largest spot that is asked: masks and needles have edges of their own."""

THRESHOLD_SET = "whoever set the threshold has set all sizes; give the image as the camera has it"


class LightError(BadInput):
    """There is no light that droplets stand out of, or it is not known; the text says what to do."""


@dataclass(frozen=True, eq=False)
class Darkness:
    """The part of an image that shows the spray.

    Parameters
    ----------
    values : (rows, columns) float32 array
        Darkness; of bright particles, brightness.
    first_row, first_column : int
        Where it begins in the image.
    noise : float
        Standard deviation where there is no droplet.
    saturated : (rows, columns) bool array
        Pixels at full scale: nobody knows how much more light it was.
    """

    values: Image
    first_row: int
    first_column: int
    noise: float
    saturated: NDArray[np.bool_]


def darkness_of(
    image: NDArray[np.generic],
    polarity: Polarity,
    background: NDArray[np.generic] | None,
    saturated: NDArray[np.bool_] | None = None,
) -> Darkness:
    """Relative darkness of an image, without a white frame around it.

    Parameters
    ----------
    image : (rows, columns) array
        Grey values, less the dark image.
    polarity : {"shadow", "bright"}
        Dark droplets before light, or bright particles on black.
    background : (rows, columns) array, optional
        The light without droplets; by default a smooth one is fitted.
    saturated : (rows, columns) bool array, optional
        Pixels at full scale, where a dark image was taken off; by default those at the end of some camera's scale.

    Raises
    ------
    LightError
        Shadows, and the light is not much more than the noise; or much of the image lies on the other side of the
        light, so that this is not known; or rows alternate.
    """
    if rows_alternate(image):
        raise LightError(ALTERNATING)
    grey = np.asarray(image, np.float32)
    _require_unprocessed(grey)
    rows, columns = _without_frame(grey)
    inner, full = grey[rows, columns], (_at_full_scale(grey) if saturated is None else saturated)[rows, columns]
    light = _fitted(inner) if background is None else _given(inner, np.asarray(background, np.float32)[rows, columns])
    if polarity == "bright":
        above = inner - light
        values = above / max(float(np.quantile(above, 0.9999)), 1e-6)
    else:
        _require_light(inner, full)
        values = 1 - inner / np.maximum(light, 1e-6 * max(float(light.max()), 1.0))
    some = values[::3, ::3]
    free = some[some < np.median(some) + 0.1]
    noise = 1.4826 * float(np.median(np.abs(free - np.median(free)))) if free.size else 0.0
    _require_known(values, noise, polarity, fitted=background is None)
    _require_edges(values)
    return Darkness(values.astype(np.float32), rows.start or 0, columns.start or 0, noise, full)


def _require_unprocessed(grey: Image) -> None:
    """Refuse what is left of an image once a threshold was set: edges lie where it says, and nobody knows it."""
    if np.all((grey == grey.min()) | (grey == grey.max())) and grey.min() < grey.max():
        raise LightError(f"has 2 grey values: {THRESHOLD_SET}")


def _require_edges(values: Image) -> None:
    """Refuse spots whose edges have nothing between dark and light: a threshold was set before noise or JPEG came."""
    dark = (values > 0.5).astype(np.uint8)
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(dark, connectivity=8)
    spots = dark * (boxes[:, cv2.CC_STAT_AREA] < LARGEST_SPOT * values.size)[labels].astype(np.uint8)
    square = np.ones((3, 3), np.uint8)
    edges = np.count_nonzero(spots) - np.count_nonzero(cv2.erode(spots, square))
    between = np.count_nonzero((np.abs(values - 0.5) < 0.25) & (cv2.dilate(spots, square) > 0))
    if edges >= FEWEST_EDGES and between < LEAST_BETWEEN * edges:
        raise LightError(
            f"has spots of two grey values: {100 * between / edges:.0f} % of their edges, limit "
            f"{100 * LEAST_BETWEEN:.0f} %, are between dark and light; {THRESHOLD_SET}"
        )


def _at_full_scale(grey: Image) -> NDArray[np.bool_]:
    return grey == grey.max() if grey.max() in FULL_SCALES else np.zeros(grey.shape, bool)


def _given(grey: Image, light: Image) -> Image:
    """The light that was given, if it can be that of the image."""
    if np.array_equal(grey, light):
        raise LightError("is its own background, pixel by pixel: whatever there was is divided out")
    if (share := np.mean(_at_full_scale(light))) > SATURATED_SHARE:
        raise LightError(
            f"has a background of which {100 * share:.0f} % are saturated: how dark droplets are is unknown"
        )
    if (most := float(np.quantile(grey, 0.98))) < LEAST_SHARE * (full := float(np.quantile(light, 0.98))):
        raise LightError(
            f"has at most {100 * most / full:.0f} % of the light of its background: is that of another exposure, or of "
            "other bits?"
        )
    if better := better_background(grey, light):
        raise LightError(f"does not fit its background, but {better}: is that exchanged, or turned?")
    if (held := _held(grey, light)) > MOST_HELD:
        raise LightError(
            f"has a background that is {100 * held:.0f} % darker where droplets are: it holds a part of them, which "
            "makes them too small; give the light without droplets"
        )
    return light


def _held(grey: Image, light: Image) -> float:
    """By how much a background is darker at dark spots of an image than beside them; 0 of few pixels, or black ones."""
    width = max(min(grey.shape) // 8, 3)
    dark = grey < 0.5 * light
    free = (~dark).astype(np.float32)
    beside = cv2.blur(light * free, (width, width)) / np.maximum(cv2.blur(free, (width, width)), 1e-3)
    lit = dark & (light > LEAST_LIT * beside)
    if np.count_nonzero(lit) < FEWEST_EDGES:
        return 0.0
    return 1 - float(np.median(light[lit] / np.maximum(beside[lit], 1e-6)))


def _require_light(grey: Image, saturated: NDArray[np.bool_]) -> None:
    if (share := np.mean(saturated)) > SATURATED_SHARE:
        raise LightError(
            f"{100 * share:.0f} % of the image are saturated: how dark droplets are is unknown, they would be too small"
        )
    middle = grey[len(grey) // 3 : len(grey) - len(grey) // 3]
    light, noise = float(np.median(middle)), noise_of(middle)
    if light <= LEAST_LIGHT * noise:
        raise LightError(
            f"the image is dark: its light is {light:.3g} at a noise of {noise:.3g}, at least {LEAST_LIGHT:g} times "
            "the noise is needed; is a lens covered, a light off, or are particles bright (--polarity bright)?"
        )


def _require_known(values: Image, noise: float, polarity: Polarity, fitted: bool) -> None:
    beyond = float(np.mean(values < -max(UNEXPLAINED, 6 * noise)))
    if beyond > MOST_UNEXPLAINED:
        brighter, other = ("brighter", "bright") if polarity == "shadow" else ("darker", "shadow")
        cause = "do droplets cover much of it (--background IMAGE)" if fitted else "is the background of another light"
        raise LightError(
            f"{100 * beyond:.1f} % of the image is much {brighter} than the light that was "
            f"{'fitted' if fitted else 'given'}: {cause}, or is the polarity another (--polarity {other})?"
        )
    if fitted and polarity == "shadow" and noise > MOST_UNEVEN:
        raise LightError(
            f"the light is not smooth: a fit leaves {100 * noise:.0f} % of it; are there steps, or several images in "
            "one (--background IMAGE)?"
        )


def _without_frame(grey: Image) -> tuple[slice, slice]:
    """Rows and columns within a frame: on all sides, and brighter than half way from the middle's light to white."""
    n_rows, n_columns = grey.shape
    rows, columns = (slice(n // 4, n - n // 4) for n in grey.shape)
    level = float(np.median(grey[rows, columns]))
    white = grey > level + max(0.5 * (float(grey.max()) - level), LEAST_FRAME * level)
    inner_rows, inner_columns = _trimmed(white[:, columns].mean(axis=1)), _trimmed(white[rows].mean(axis=0))
    if inner_rows is None or inner_columns is None:
        return slice(0, n_rows), slice(0, n_columns)
    return inner_rows, inner_columns


def _trimmed(white: NDArray[np.floating]) -> slice | None:
    """From the first to the last line that is not of the frame, by the white share of lines; None without a frame.

    A line beside the frame may be half of it. Its edge is straight, as that of light around a large droplet is not:
    two lines further nothing is white.
    """
    inside = np.flatnonzero(white <= 0.5)
    if len(inside) < 5 or inside[0] == 0 or inside[-1] == len(white) - 1:
        return None
    first, last = int(inside[0]) + 1, int(inside[-1])
    straight = max(white[first + 1], white[last - 2]) <= MOST_WHITE
    return slice(first, last) if straight else None


def _fitted(grey: Image) -> Image:
    """Light as a polynomial of second order, fitted to what lies on it: droplets do not."""
    step = tuple(max(1, n // _GRID) for n in grey.shape)
    sampled = grey[:: step[0], :: step[1]]
    basis = _basis(np.arange(0, grey.shape[0], step[0]), np.arange(0, grey.shape[1], step[1]), grey.shape)
    values = sampled.ravel().astype(np.float64)
    kept = np.abs(values - np.median(values)) <= max(0.3 * float(np.median(values)), 1.0)
    for _ in range(FITS):
        coefficients = np.linalg.lstsq(basis[kept], values[kept], rcond=None)[0]
        off = values - basis @ coefficients
        sigma = 1.4826 * float(np.median(np.abs(off[kept] - np.median(off[kept]))))
        kept = np.abs(off) <= max(OFF_SIGMAS * sigma, 1e-3 * float(np.abs(values).max()))
        if np.count_nonzero(kept) < 2 * basis.shape[1]:
            return np.full(grey.shape, np.median(grey), np.float32)
    v, u = (np.linspace(-1, 1, n, endpoint=False, dtype=np.float32) for n in grey.shape)
    level, along_u, along_v, bent_u, twist, bent_v = coefficients.astype(np.float32)
    light: Image = (
        (level + along_u * u + bent_u * u**2)[None] + (along_v * v + bent_v * v**2)[:, None] + twist * v[:, None] * u
    )
    return light


def _basis(rows: NDArray[np.int64], columns: NDArray[np.int64], shape: tuple[int, ...]) -> NDArray[np.float64]:
    v, u = np.meshgrid(2 * rows / shape[0] - 1, 2 * columns / shape[1] - 1, indexing="ij")
    return np.column_stack([term.ravel() for term in (np.ones_like(u), u, v, u * u, u * v, v * v)])
