"""How a lens shows an opaque disc in light from more or fewer directions: Abbe's sum, as a radial spectrum.

A condenser whose aperture is a share of the lens's lights the spray from few directions. Each direction makes a
coherent image, the squared modulus of a field, and they add up (Abbe):

    I(x) = sum over source points s of | F^-1 [ F(disc) pupil(f + s) ] |^2

Light from beyond the aperture of the lens does not pass it but for what the disc diffracts. From all directions the sum
is the product of spectrum and optical transfer function (Goodman, Introduction to Fourier Optics, 6.3).

Lengths are in Airy disks d_A / M in the object, so that one table per condenser serves all lenses. What a disc changes
in light of 1 is, averaged around it, ``sum over f of spectrum(f) J0(2 pi f r)`` at the distance r from its centre.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.special import j0, j1

FloatArray = NDArray[np.float64]
CUT_PER_AIRY = 1.22
"""Spatial frequency, per Airy disk, at the edge of the pupil: NA / lambda."""
CORE_SIGMA = 0.42 / 2.44
"""Sigma of the Gaussian with the core of the Airy pattern, in Airy disks."""
SIZE, PER_AIRY = 128, 6
"""Field of one image, 21 Airy disks; squared fields hold no frequency above twice the cut."""
SOURCE_RINGS = 8
"""Within the aperture of the lens."""
FURTHER_RINGS = 8
"""Beyond it, per aperture."""
MOST_RATIO = 8.0
"""From this ratio on light is taken as coming from all directions; edges still move by 0.01 Airy disks."""


def disc_image(diameter_airy: float, condenser_ratio: float) -> FloatArray:
    """Intensity of an opaque disc in the middle of the field, (rows, columns), 1 / 6 of an Airy disk apart.

    Parameters
    ----------
    diameter_airy : float
        In Airy disks.
    condenser_ratio : float
        Numerical aperture of the light over that of the lens: 0.02 is almost coherent, 1 fills the lens.
    """
    return np.asarray(np.fft.fftshift(_centred(diameter_airy, condenser_ratio)), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Circles:
    """Circles of equal frequency in the spectrum of the field.

    Parameters
    ----------
    per_airy : (F,) array
        Frequencies up to twice the cut.
    numbers : (N,) array
        Of the circle of each point of the spectrum; those of F and above hold nothing.
    """

    per_airy: FloatArray
    numbers: NDArray[np.intp]

    def spectrum(self, diameter_airy: float, condenser_ratio: float) -> FloatArray:
        """Sums (F,) around the circles of what a disc changes in the light."""
        changed = np.fft.fft2(_centred(diameter_airy, condenser_ratio) - 1).real / SIZE**2
        sums = np.bincount(self.numbers, changed.ravel())[: len(self.per_airy)]
        return np.asarray(sums, dtype=np.float64)


@cache
def circles() -> Circles:
    """Those of the field."""
    steps = np.rint(SIZE * np.fft.fftfreq(SIZE)).astype(int)
    squared, numbers = np.unique(steps[:, None] ** 2 + steps**2, return_inverse=True)
    frequencies = np.sqrt(squared) * PER_AIRY / SIZE
    return Circles(frequencies[frequencies <= 2 * CUT_PER_AIRY], numbers.ravel())


def _centred(diameter_airy: float, condenser_ratio: float) -> FloatArray:
    """The image with the middle of the disc at its first pixel."""
    along = np.fft.fftfreq(SIZE, 1 / PER_AIRY)
    radial = np.hypot(along[:, None], along)
    if condenser_ratio >= MOST_RATIO:
        share = np.minimum(radial / (2 * CUT_PER_AIRY), 1)
        transfer = 2 / np.pi * (np.arccos(share) - share * np.sqrt(1 - share**2))
        return np.asarray(1 - PER_AIRY**2 * np.fft.ifft2(_disc(radial, diameter_airy) * transfer).real)
    pupil, places = radial <= CUT_PER_AIRY, np.rint(along * SIZE / PER_AIRY) / PER_AIRY
    rows, columns = np.nonzero(pupil)
    image, passed = np.zeros((SIZE, SIZE), np.float32), np.zeros((SIZE, SIZE), np.complex64)
    # One point per ring of the source: the mean around the disc does for the others.
    for source, weight in _rings(condenser_ratio):
        passed[rows, columns] = PER_AIRY**2 * _disc(np.hypot(along[rows], along[columns] + source), diameter_airy)
        direct = np.exp(-2j * np.pi * source * places) if source <= CUT_PER_AIRY else np.zeros(SIZE)
        field = direct.astype(np.complex64) - fft.ifft2(passed)
        image += np.float32(weight) * (field.real**2 + field.imag**2)
    return image.astype(np.float64)


def _rings(condenser_ratio: float) -> list[tuple[float, float]]:
    """Frequencies of rings of the source, and their weights: those that pass the lens weigh 1 together."""
    inner = min(condenser_ratio, 1.0)
    parts = [(0.0, inner**2, SOURCE_RINGS)]
    if condenser_ratio > 1:
        parts.append((1.0, condenser_ratio**2, SOURCE_RINGS + int(FURTHER_RINGS * (condenser_ratio - 1))))
    rings: list[tuple[float, float]] = []
    for low, high, number in parts:
        nodes, weights = np.polynomial.legendre.leggauss(number)
        squares = low + (high - low) * (0.5 + 0.5 * nodes)
        rings += zip(CUT_PER_AIRY * np.sqrt(squares), 0.5 * weights * (high - low) / inner**2, strict=True)
    return rings


def _disc(frequencies: FloatArray, diameter_airy: float) -> FloatArray:
    """Spectrum of a disc."""
    radius = 0.5 * diameter_airy
    with np.errstate(invalid="ignore"):
        ring = radius * j1(2 * np.pi * radius * frequencies) / frequencies
    return np.asarray(np.where(frequencies > 0, ring, np.pi * radius**2), dtype=np.float64)


def blurred(frequencies: FloatArray, sigma_airy: FloatArray | float) -> FloatArray:
    """What a Gaussian blur leaves of frequencies (F,)."""
    return np.asarray(np.exp(-2 * (np.pi * np.asarray(sigma_airy) * frequencies) ** 2), dtype=np.float64)


def waves(frequencies: FloatArray, distances_airy: FloatArray) -> FloatArray:
    """J0 (F, D) of frequencies and distances."""
    return np.asarray(j0(2 * np.pi * frequencies[:, None] * distances_airy), dtype=np.float64)
