"""The paper's simulated shots: Gaussian droplets in a volume, and the images that pinhole cameras take of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.geometry import FloatArray, PinholeCamera, view_camera
from processing.synthetic.paper_rig import IMAGE_SCALE_PX_PER_MM, TABLE_1
from processing.volume import VoxelGrid

Volume = NDArray[np.float32]
Image = NDArray[np.float32]

SCALE_VOXEL_PER_MM = IMAGE_SCALE_PX_PER_MM
AZIMUTHS_DEG = tuple(row.azimuth_deg for row in TABLE_1.values())
IMAGE_SIZE_PX = (600, 560)
PAPER_SHAPE = (250, 500, 500)
PAPER_COUNTS = (1000, 2000, 4000, 8000, 16000)
FAINTEST = 1e-3
"""Blobs end where they fall below this share of their maximum."""


@dataclass(frozen=True, eq=False)
class SimulatedShot:
    """Droplets, and what the views see of them.

    Parameters
    ----------
    centres_voxel : (N, 3) array
        True positions as voxel indices (z, y, x).
    truth : (z, y, x) float32 array
        True intensities.
    images : list of (rows, columns) float32 arrays
        One per camera, normalised together.
    """

    centres_voxel: FloatArray
    truth: Volume
    images: list[Image]


def simulate_shot(grid: VoxelGrid, count: int, sigma_voxel: float, cameras: Sequence[PinholeCamera]) -> SimulatedShot:
    """Fill a grid with droplets and look at them; seeded with their number, so the same call gives the same shot."""
    centres_voxel = droplet_centres(grid.shape, count, np.random.default_rng(count))
    truth = blob_volume(grid.shape, centres_voxel, sigma_voxel)
    images = normalised([project_volume(truth, grid, camera) for camera in cameras])
    return SimulatedShot(centres_voxel, truth, images)


def study_grid(shape: tuple[int, int, int]) -> VoxelGrid:
    """A simulated volume at the paper's 60 voxel/mm, centred on the world origin."""
    return VoxelGrid.centred(shape, 1 / SCALE_VOXEL_PER_MM)


def study_cameras(image_size_px: tuple[int, int] = IMAGE_SIZE_PX) -> list[PinholeCamera]:
    """The four views of the experiment (Table 1) as ideal pinhole cameras."""
    return [
        view_camera(
            row.azimuth_deg,
            focal_length_mm=row.focal_length_mm,
            magnification=row.magnification,
            scale_px_per_mm=SCALE_VOXEL_PER_MM,
            image_size_px=image_size_px,
        )
        for row in TABLE_1.values()
    ]


def droplet_centres(shape: tuple[int, int, int], count: int, rng: np.random.Generator) -> FloatArray:
    """Uniformly distributed positions (N, 3) as voxel indices (z, y, x)."""
    centres_xyz: FloatArray = rng.uniform(0, np.array(shape[::-1]) - 1, (count, 3))
    return centres_xyz[:, ::-1]


def blob_volume(shape: tuple[int, int, int], centres_voxel: FloatArray, sigma_voxel: float) -> Volume:
    """Volume (z, y, x) of Gaussian blobs of height 1 around positions (N, 3); overlaps add up."""
    volume = np.zeros(shape, dtype=np.float32)
    reach = max(2, int(np.ceil(3.5 * sigma_voxel)))
    for centre in centres_voxel:
        nearest = np.rint(centre).astype(int)
        first, end = np.maximum(nearest - reach, 0), np.minimum(nearest + reach + 1, shape)
        offsets = [np.arange(a, b) - c for a, b, c in zip(first, end, centre, strict=True)]
        along_z, along_y, along_x = (np.exp(-(offset**2) / (2 * sigma_voxel**2)) for offset in offsets)
        region = tuple(slice(a, b) for a, b in zip(first, end, strict=True))
        volume[region] += along_z[:, None, None] * along_y[:, None] * along_x
    volume[volume < FAINTEST] = 0
    return volume


def project_volume(volume: Volume, grid: VoxelGrid, camera: PinholeCamera) -> Image:
    """Image (rows, columns) of a volume: each plane interpolated bilinearly at the pixels (eq. 5), then summed."""
    image = np.zeros(camera.image_size_px[::-1], dtype=np.float32)
    x_mm, y_mm, _ = grid.origin_mm
    to_plane = np.array([[grid.pitch_mm, 0, x_mm], [0, grid.pitch_mm, y_mm], [0, 0, 1]])
    for plane, z_mm in zip(volume, grid.z_mm, strict=True):
        to_image: FloatArray = camera.plane_homography(float(z_mm)) @ to_plane
        image += cv2.warpPerspective(plane, to_image, camera.image_size_px, flags=cv2.INTER_LINEAR)
    return image


def normalised(images: Sequence[Image]) -> list[Image]:
    """Images divided by the brightest pixel of all."""
    brightest = max(float(image.max()) for image in images)
    return [image / np.float32(brightest) for image in images]
