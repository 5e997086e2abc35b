"""How dark a pixel is, relative to the light behind it: 0 where light is free, about 1 in a droplet."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.image_noise import noise_of
from processing.errors import BadInput
from processing.preprocessing import Polarity

FITS = 6
"""How often the background is fitted again without what lies off it."""
OFF_SIGMAS = 2.5
LEAST_FRAME = 0.03
"""Of the light: a frame is brighter by more."""
_GRID = 64
"""The background is fitted to about so many pixels along each side."""

LEAST_LIGHT = 5.0
"""Over the noise."""
Image = NDArray[np.float32]


class DarkImageError(BadInput):
    """An image of shadows has no light; the text says how dark it is."""


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
    """

    values: Image
    first_row: int
    first_column: int
    noise: float


def darkness_of(image: NDArray[np.generic], polarity: Polarity, background: NDArray[np.generic] | None) -> Darkness:
    """Relative darkness of an image, without a white frame around it.

    Parameters
    ----------
    image : (rows, columns) array
        Grey values, less the dark image.
    polarity : {"shadow", "bright"}
        Dark droplets before light, or bright particles on black.
    background : (rows, columns) array, optional
        The light without droplets; by default a smooth one is fitted.

    Raises
    ------
    DarkImageError
        Shadows, and the light is not much more than the noise.
    """
    grey = np.asarray(image, np.float32)
    rows, columns = _without_frame(grey)
    inner = grey[rows, columns]
    light = _fitted(inner) if background is None else np.asarray(background, np.float32)[rows, columns]
    if polarity == "bright":
        above = inner - light
        values = above / max(float(np.quantile(above, 0.9999)), 1e-6)
    else:
        _require_light(inner)
        values = 1 - inner / np.maximum(light, 1e-6 * max(float(light.max()), 1.0))
    some = values[::3, ::3]
    free = some[some < np.median(some) + 0.1]
    noise = 1.4826 * float(np.median(np.abs(free - np.median(free)))) if free.size else 0.0
    return Darkness(values.astype(np.float32), rows.start or 0, columns.start or 0, noise)


def _require_light(grey: Image) -> None:
    middle = grey[len(grey) // 3 : len(grey) - len(grey) // 3]
    light, noise = float(np.median(middle)), noise_of(middle)
    if light <= LEAST_LIGHT * noise:
        raise DarkImageError(
            f"the image is dark: its light is {light:.3g} at a noise of {noise:.3g}, at least {LEAST_LIGHT:g} times "
            "the noise is needed; is a lens covered, a light off, or are particles bright (--polarity bright)?"
        )


def _without_frame(grey: Image) -> tuple[slice, slice]:
    """Rows and columns within a frame: at the edges, and brighter than half way from the middle's light to white."""
    n_rows, n_columns = grey.shape
    middle = grey[n_rows // 4 : n_rows - n_rows // 4, n_columns // 4 : n_columns - n_columns // 4]
    level = float(np.median(middle))
    limit = level + max(0.5 * (float(grey.max()) - level), LEAST_FRAME * level)
    return _trimmed(np.median(grey[:, n_columns // 4 : -n_columns // 4], axis=1) > limit), _trimmed(
        np.median(grey[n_rows // 4 : -n_rows // 4], axis=0) > limit
    )


def _trimmed(is_frame: NDArray[np.bool_]) -> slice:
    """From the first to the last line that is not of the frame; a line beside the frame may be half of it."""
    inside = np.flatnonzero(~is_frame)
    first, last = (int(inside[0]), int(inside[-1])) if len(inside) else (0, len(is_frame) - 1)
    return slice(first + (first > 0), last + 1 - (last < len(is_frame) - 1))


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
