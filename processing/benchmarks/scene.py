"""What the speed study looks at: a hollow cone of droplets, seen by the paper's four views with real lenses."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.geometry import PinholeCamera, view_camera
from processing.preprocessing import Frame
from processing.synthetic.paper_rig import IMAGE_SCALE_PX_PER_MM, TABLE_1
from processing.volume import VoxelGrid

Image = NDArray[np.float32]

SCALE_PX_PER_MM = IMAGE_SCALE_PX_PER_MM
PITCHES_DEG = (3.0, -2.0, 2.0, -3.0)
DISTORTIONS = (
    (2.0, 50, 0.004, -0.003, 0),
    (-1.5, 20, -0.003, 0.004, 0),
    (2.5, 0, 0.002, 0.005, 0),
    (-2, 30, 0.005, 0.002, 0),
)
"""1.5 to 3 px in the corners, as macro lenses have."""


@dataclass(frozen=True)
class SpeedStudy:
    """What is measured.

    Parameters
    ----------
    shape : tuple[int, int, int]
        The volume (nz, ny, nx), one voxel per pixel.
    image_size_px : tuple[int, int]
        (width, height) of every view.
    droplets : int
        In a hollow cone around the axis y.
    repeats : int
        Medians are taken over so many runs.
    baseline_planes : int
        The baseline computes so many planes, spread over the volume, and is scaled to all.
    iterations : int
        Of SMART.
    sparse_droplets : int
        As many as it takes for a spray of 4 % occupancy.
    mean_exposures : int
        Exposures of the mean volume.
    threads : int
        Of the kernels; the baseline has one.
    """

    shape: tuple[int, int, int] = (541, 1036, 1081)
    image_size_px: tuple[int, int] = (1600, 1200)
    droplets: int = 12_000
    repeats: int = 5
    baseline_planes: int = 12
    iterations: int = 20
    sparse_droplets: int = 7_700
    mean_exposures: int = 266
    threads: int = 2

    @property
    def grid(self) -> VoxelGrid:
        """The volume, centred on the world origin."""
        return VoxelGrid.centred(self.shape, 1 / SCALE_PX_PER_MM)


QUICK = SpeedStudy(
    (48, 160, 200),
    (320, 240),
    droplets=200,
    repeats=2,
    baseline_planes=3,
    iterations=2,
    sparse_droplets=50,
    mean_exposures=10,
)
"""Shows that everything is measured; the figures mean little."""


def study_cameras(image_size_px: tuple[int, int]) -> list[PinholeCamera]:
    """The four views of the experiment, pitched and distorted."""
    return [
        view_camera(
            row.azimuth_deg,
            focal_length_mm=row.focal_length_mm,
            magnification=row.magnification,
            scale_px_per_mm=SCALE_PX_PER_MM,
            image_size_px=image_size_px,
            pitch_deg=pitch_deg,
            distortion=np.array(distortion),
        )
        for row, pitch_deg, distortion in zip(TABLE_1.values(), PITCHES_DEG, DISTORTIONS, strict=True)
    ]


def spray_images(study: SpeedStudy, cameras: Sequence[PinholeCamera], seed: int = 1) -> list[Image]:
    """Shadow intensities of a hollow cone of droplets, preprocessed: nothing between the droplets."""
    rng = np.random.default_rng(seed)
    depth_mm, height_mm, width_mm = (n / SCALE_PX_PER_MM for n in study.shape)
    down = rng.uniform(0.02, 1, study.droplets)
    angle_rad, radius = rng.uniform(0, 2 * np.pi, study.droplets), down * rng.normal(0.47, 0.04, study.droplets)
    points_mm = np.column_stack(
        [width_mm * radius * np.cos(angle_rad), height_mm * (down - 0.5), depth_mm * radius * np.sin(angle_rad)]
    )
    diameters_px = np.clip(rng.lognormal(np.log(2.7), 0.45, study.droplets), 0.9, 15)
    return [_draw(camera.project(points_mm), diameters_px, study.image_size_px) for camera in cameras]


def sparse_images(study: SpeedStudy, cameras: Sequence[PinholeCamera], seed: int = 1) -> list[Image]:
    """As ``spray_images``, of fewer droplets."""
    return spray_images(replace(study, droplets=study.sparse_droplets), cameras, seed)


def dense_images(study: SpeedStudy, cameras: Sequence[PinholeCamera], seed: int = 1) -> list[Image]:
    """As ``spray_images``, behind a veil: no voxel is empty."""
    return [image + np.float32(0.02) for image in spray_images(study, cameras, seed)]


@dataclass(frozen=True, eq=False)
class RawExposure:
    """What a camera recorded of one exposure, and its references."""

    frame: Frame
    bits: int
    dark: Image
    background: Image


def raw_exposures(images: Sequence[Image], bits: int) -> list[RawExposure]:
    """Exposures that become given intensities, under uneven light and with noise; above 8 bits in words of 16."""
    rng = np.random.default_rng(2)
    full_scale = 2**bits - 1
    exposures = []
    for image in images:
        rows, columns = (np.linspace(-1, 1, n, dtype=np.float32) for n in image.shape)
        dark = np.full(image.shape, 0.02 * full_scale, np.float32)
        field = np.float32(0.75 * full_scale) * (1 - 0.2 * (rows[:, None] ** 2 + columns**2))
        noise = rng.normal(0, 0.005 * full_scale, image.shape)
        light = np.clip(dark + field * (1 - image) + noise, 0, full_scale)
        frame = light.astype(np.uint8) if bits == 8 else light.astype(np.uint16)
        exposures.append(RawExposure(frame, bits, dark, dark + field))
    return exposures


def _draw(points_px: NDArray[np.float64], diameters_px: NDArray[np.float64], image_size_px: tuple[int, int]) -> Image:
    canvas = np.zeros(image_size_px[::-1], np.uint8)
    for centre, diameter_px in zip(np.rint(points_px * 16).astype(int), diameters_px, strict=True):
        cv2.circle(canvas, tuple(centre.tolist()), int(diameter_px * 8), 255, cv2.FILLED, cv2.LINE_AA, shift=4)
    blurred = cv2.GaussianBlur(canvas.astype(np.float32) / np.float32(255), (0, 0), 0.7)
    return np.where(blurred < 0.02, np.float32(0), blurred)
