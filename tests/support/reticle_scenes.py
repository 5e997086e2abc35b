"""Images of a reticle by an oracle: ellipses in Abbe's sum over points all over the source, on a grid of its own."""

from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.special import j1

from processing.geometry import FloatArray, PinholeCamera
from processing.studies.simulated_droplets import study_cameras

AIRY_PX = 3.9
"""Diameter of the Airy disk in the image."""
BLUR_PX = 0.9
"""Of a lens that is not sharp."""
PER_AIRY, SIZE, SOURCE_POINTS = 8, 128, 40
DIAMETERS_UM = (30.0, 60.0, 110.0, 200.0)
IMAGE_SIZE_PX = (420, 300)
Ratio = float | Literal["gaussian"] | None
"""Of the light's aperture to the lens's; None: light from all directions; gaussian: all that is seen is a blur."""


@dataclass(frozen=True, eq=False)
class ReticleScene:
    """Dots on a plane, and their images."""

    points_mm: FloatArray
    diameters_um: FloatArray
    images: list[np.ndarray[tuple[int, int], np.dtype[np.float32]]]
    cameras: list[PinholeCamera]


def reticle_scene(
    condenser_ratio: Ratio,
    *,
    diameters_um: tuple[float, ...] = DIAMETERS_UM,
    columns: int = 5,
    pitch_mm: float = 0.45,
    tilt_rad: tuple[float, float] = (0.1, -0.06),
    noise: float = 0.002,
    seed: int = 1,
) -> ReticleScene:
    """A row of dots for every diameter, on a plane that is tilted around x and y, seen by the paper's views."""
    rng, cameras = np.random.default_rng(seed), study_cameras(IMAGE_SIZE_PX)
    across = np.array([np.cos(tilt_rad[1]), 0, np.sin(tilt_rad[1])])
    down = np.array([0, np.cos(tilt_rad[0]), np.sin(tilt_rad[0])])
    places = [(row, column) for row in range(len(diameters_um)) for column in range(columns)]
    middle = np.array([(len(diameters_um) - 1) / 2, (columns - 1) / 2])
    points_mm = np.array([pitch_mm * ((r - middle[0]) * down + (c - middle[1]) * across) for r, c in places])
    sizes_um = np.array([diameters_um[row] for row, _ in places])
    images = []
    for camera in cameras:
        image = np.ones(IMAGE_SIZE_PX[::-1])
        for point_mm, size_um in zip(points_mm, sizes_um, strict=True):
            _darken(image, camera, point_mm, size_um, (across, down), condenser_ratio)
        images.append((image + rng.normal(0, noise, image.shape)).astype(np.float32))
    return ReticleScene(points_mm, sizes_um, images, cameras)


def _darken(
    image: FloatArray,
    camera: PinholeCamera,
    point_mm: FloatArray,
    diameter_um: float,
    axes: tuple[FloatArray, FloatArray],
    ratio: Ratio,
) -> None:
    step_mm = 0.02
    sides = [(camera.project(point_mm + step_mm * a) - camera.project(point_mm - step_mm * a))[0] for a in axes]
    matrix = np.column_stack(sides) / (2 * step_mm) * diameter_um / 2000 / AIRY_PX
    dot = ellipse_image(tuple(np.round(matrix, 3).ravel().tolist()), ratio)
    u, v = camera.project(point_mm[None])[0]
    half = int(0.5 * SIZE / PER_AIRY * AIRY_PX) - 2
    rows = np.arange(max(int(v) - half, 0), min(int(v) + half, image.shape[0]))
    columns = np.arange(max(int(u) - half, 0), min(int(u) + half, image.shape[1]))
    at = np.meshgrid((rows - v) / AIRY_PX * PER_AIRY, (columns - u) / AIRY_PX * PER_AIRY, indexing="ij")
    image[np.ix_(rows, columns)] *= map_coordinates(dot, np.array(at) + SIZE // 2, order=3)


@cache
def ellipse_image(matrix_airy: tuple[float, float, float, float], ratio: Ratio) -> FloatArray:
    """Light around an ellipse, the unit circle times a matrix (column, row), blurred by the area of a pixel too."""
    f = np.fft.fftfreq(SIZE, 1 / PER_AIRY)
    along, down = f[None, :], f[:, None]
    a, b, c, d = matrix_airy
    k = np.hypot(a * along + c * down, b * along + d * down)
    with np.errstate(invalid="ignore"):
        ellipse = abs(a * d - b * c) * np.where(k > 0, j1(2 * np.pi * k) / k, np.pi)
    pixel = np.sinc(along / AIRY_PX) * np.sinc(down / AIRY_PX)
    if ratio == "gaussian":
        passed = np.exp(-2 * (np.pi * BLUR_PX / AIRY_PX) ** 2 * (along**2 + down**2))
        return np.asarray(np.fft.fftshift(1 - PER_AIRY**2 * np.fft.ifft2(ellipse * passed * pixel).real))
    if ratio is None:
        # What is left of a spatial frequency in incoherent light.
        s = np.minimum(np.hypot(along, down) / 2.44, 1)
        passed = 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2))
        return np.asarray(np.fft.fftshift(1 - PER_AIRY**2 * np.fft.ifft2(ellipse * passed * pixel).real))
    k = np.arange(SOURCE_POINTS) + 0.5
    light = np.zeros((SIZE, SIZE))
    for source in 1.22 * ratio * np.sqrt(k / SOURCE_POINTS) * np.exp(1j * k * np.pi * (3 - 5**0.5)):
        pupil = np.hypot(along + source.real, down + source.imag) <= 1.22
        light += np.abs(1 - PER_AIRY**2 * np.fft.ifft2(ellipse * pupil)) ** 2 / SOURCE_POINTS
    return np.asarray(np.fft.fftshift(np.fft.ifft2(np.fft.fft2(light) * pixel).real))
