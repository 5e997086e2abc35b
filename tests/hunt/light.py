"""What opaque bodies leave of the light: fine masks behind a Gaussian blur, or Abbe's sum; and bright spots."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import fft2, ifft2, irfft2, next_fast_len, rfft2
from scipy.ndimage import gaussian_filter

Array = NDArray[np.float64]
FINE = 4
"""Samples of a mask per pixel along rows and columns."""
LIGHTS = 64
"""Points of a source as wide as the lens; wider ones have as many where the lens sees them."""
ALL_ROUND = 4.0
"""Apertures of the lens from which on light comes from all directions: images add up then, not waves."""


@dataclass(frozen=True, eq=False)
class Bodies:
    """Opaque bodies as a view sees them.

    Parameters
    ----------
    places_px : (N, 2) array
        Middles, column and row.
    radii_px : (N,) array
        Of discs, or of the ends of rods.
    halves_px : (N, 2) array
        From the middle of a rod to where its end begins; 0 of a disc.
    squeeze : float
        Height over width of all of them.
    """

    places_px: Array
    radii_px: Array
    halves_px: Array
    squeeze: float = 1.0


def covered(bodies: Bodies, size_px: tuple[int, int]) -> Array:
    """Share of each fine sample that is covered, (FINE * rows, FINE * columns); bodies unite.

    Their edges fall off over a sample, which makes a disc larger by pi / 12 of one: it is drawn smaller.
    """
    columns, rows = size_px
    mask = np.zeros((FINE * rows, FINE * columns))
    middles, halves = (bodies.places_px + 0.5) * FINE - 0.5, FINE * bodies.halves_px
    radii = np.sqrt(np.maximum((FINE * bodies.radii_px) ** 2 - 1 / 12, 0))
    for (u, v), (du, dv), radius in zip(middles, halves, radii, strict=True):
        reach = radius + np.hypot(du, dv) + 2
        across, down = (slice(max(0, int(at - reach)), max(0, int(at + reach) + 2)) for at in (u, v))
        part = mask[down, across]
        if part.size:
            row, column = np.ogrid[down.start : down.start + part.shape[0], across.start : across.start + part.shape[1]]
            x, y = column - u, (row - v) / bodies.squeeze
            along = np.clip((x * du + y * dv) / max(du * du + dv * dv, 1e-9), -1, 1)
            np.maximum(part, np.clip(radius + 0.5 - np.hypot(x - along * du, y - along * dv), 0, 1), out=part)
    return mask


def behind_blur(mask: Array, blur_px: float) -> Array:
    """Light that a Gaussian blur lets through, in pixels, (rows, columns)."""
    blurred = gaussian_filter(mask, blur_px * FINE, truncate=5.0) if blur_px else mask
    rows, columns = np.array(mask.shape) // FINE
    return np.asarray(1 - blurred.reshape(rows, FINE, columns, FINE).mean(axis=(1, 3)))


def by_waves(mask: Array, ratio: float, airy_px: float) -> Array:
    """Light behind a sharp lens, in pixels: Abbe's sum over a source of ``ratio`` apertures of the lens.

    Waves of each point of the source pass the mask and the pupil; what they are on the sensor adds up (Born and Wolf,
    10.6.2). Light from all directions is what the lens makes of the mask itself.
    """
    size = (mask.shape[0] // FINE, mask.shape[1] // FINE)
    if ratio >= ALL_ROUND:
        return 1 - _in_pixels(rfft2(mask), mask.shape, size, airy_px)
    fine = tuple(min(next_fast_len(int(1.25 * side)), FINE * side) for side in size)
    waves, rim = fft2(1 - mask) * (fine[0] * fine[1] / mask.size), 1.22 / airy_px
    rows, columns = (np.fft.fftfreq(kept, 1 / kept).astype(int) for kept in fine)
    pupil = np.hypot(rows[:, None] / size[0], columns / size[1]) <= rim
    image, straight = np.zeros(fine), 0
    for down, across in np.rint(_source(ratio * rim, int(LIGHTS * max(ratio, 1) ** 2)) * size).astype(int):
        straight += np.hypot(down / size[0], across / size[1]) <= rim
        passed = waves[np.ix_((rows + down) % mask.shape[0], (columns + across) % mask.shape[1])] * pupil
        image += np.abs(ifft2(passed)) ** 2
    return _in_pixels(rfft2(image / straight), fine, size, None)


def _source(radius: float, count: int) -> Array:
    """Points all over a disc, (N, 2), in turns of the golden angle."""
    turn = np.arange(count) + 0.5
    points = radius * np.sqrt(turn / count) * np.exp(1j * np.pi * (3 - np.sqrt(5)) * turn)
    return np.column_stack([points.real, points.imag])


def _in_pixels(
    spectrum: NDArray[np.complex128], fine: tuple[int, ...], size: tuple[int, int], airy_px: float | None
) -> Array:
    """An image of which a spectrum on a finer grid is known, averaged over pixels; a lens blurs it first, if any."""
    down, across = np.fft.fftfreq(fine[0], size[0] / fine[0])[:, None], np.fft.rfftfreq(fine[1], size[1] / fine[1])
    turned = np.exp(2j * np.pi * (down + across) * 0.5 * (1 - 1 / FINE))
    kept = spectrum * np.sinc(down) * np.sinc(across) * turned
    if airy_px:
        share = np.minimum(np.hypot(down, across) * airy_px / 2.44, 1)
        kept = kept * 2 / np.pi * (np.arccos(share) - share * np.sqrt(1 - share**2))
    rows, columns = 2 * size[0], 2 * size[1]
    wide = np.zeros((rows, columns // 2 + 1), complex)
    half = min(fine[0], rows) // 2
    reach = min(kept.shape[1], wide.shape[1])
    wide[:half, :reach], wide[-half:, :reach] = kept[:half, :reach], kept[-half:, :reach]
    return np.asarray(irfft2(wide, (rows, columns))[::2, ::2]) * (rows * columns / (fine[0] * fine[1]))


def spots(places_px: Array, heights: Array, sigma_px: float, size_px: tuple[int, int]) -> Array:
    """Bright Gaussian spots that add up, (rows, columns)."""
    image = np.zeros(size_px[::-1])
    row, column = np.ogrid[: size_px[1], : size_px[0]]
    for (u, v), height in zip(places_px, heights, strict=True):
        image += height * np.exp(-((row - v) ** 2 + (column - u) ** 2) / (2 * sigma_px**2))
    return image
