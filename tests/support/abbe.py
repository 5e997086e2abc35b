"""Abbe's sum over points all over the source: an oracle for partially coherent light, with a grid of its own."""

import numpy as np

from processing.geometry import FloatArray

PER_AIRY, SIZE = 24, 256
"""Pixels of an Airy disk, and of the image."""


def abbe(discs_airy: list[tuple[float, float, float]], ratio: float) -> FloatArray:
    """Image of drawn discs (row, column, radius), by points all over the source: another grid and another sum."""
    rows = ((np.arange(SIZE) - SIZE // 2)[:, None] + (np.arange(8) - 3.5) / 8).ravel() / PER_AIRY
    mask = np.zeros((len(rows), len(rows)), bool)
    for row, column, radius in discs_airy:
        mask |= (rows[:, None] - row) ** 2 + (rows - column) ** 2 < radius**2
    field = np.fft.fft2(1 - mask.reshape(SIZE, 8, SIZE, 8).mean(axis=(1, 3)))
    points = int(100 * max(ratio, 1.0) ** 2)
    frequencies, k = np.fft.fftfreq(SIZE, 1 / PER_AIRY), np.arange(points) + 0.5
    image = np.zeros((SIZE, SIZE))
    for source in 1.22 * ratio * np.sqrt(k / points) * np.exp(1j * k * np.pi * (3 - 5**0.5)):
        pupil = np.hypot(frequencies[:, None] + source.imag, frequencies + source.real) <= 1.22
        image += np.abs(np.fft.ifft2(field * pupil)) ** 2
    return np.asarray(image / image[0, 0])
