"""Small shots of shadows with their truth, by an oracle: fine masks that are united, then blurred by scipy."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from daq.files.run_directory import DoubleFrame, ExposureRecord, ImageKey, RunHeader, RunWriter, Shot, ViewFormat
from processing.analysis.droplets.droplet_search import DropletSearch, plan_droplets
from processing.calibration.calibration_file import save_calibration
from processing.calibration.calibration_record import content_id
from processing.geometry import FloatArray, PinholeCamera
from processing.studies.seen_droplets import droplet_calibration
from processing.studies.simulated_droplets import droplet_centres, study_cameras, study_grid
from processing.studies.velocity.double_scenes import SEPARATION_NS
from processing.volume import VoxelGrid

BLURS_PX = (0.95, 0.72, 0.72, 0.95)
FINE = 5
"""Samples per pixel along a row and a column; odd, so that one is at its centre."""


@dataclass(frozen=True, eq=False)
class ShadowScene:
    """A simulated shot: droplets, their images, and the cameras."""

    points_mm: FloatArray
    diameters_mm: FloatArray
    images: list[np.ndarray[tuple[int, int], np.dtype[np.float32]]]
    cameras: list[PinholeCamera]
    grid: VoxelGrid


def scale_px_per_mm(camera: PinholeCamera, points_mm: FloatArray) -> FloatArray:
    """By the plane across the optical axis: focal length over depth."""
    depths_mm = points_mm @ camera.rotation[2] + camera.translation_mm[2]
    return np.asarray(camera.camera_matrix[0, 0] / depths_mm)


def united_shadow(
    centres_px: FloatArray, radii_px: FloatArray, blur_px: float, size_px: tuple[int, int], *, sharp: bool = False
) -> FloatArray:
    """What is let through by opaque discs that unite, then are blurred: by a Gaussian, or as a sharp lens does."""
    width_px, height_px = size_px
    mask = np.zeros((height_px * FINE, width_px * FINE), np.float32)
    for (u, v), radius_px in zip((centres_px + 0.5) * FINE - 0.5, radii_px * FINE, strict=True):
        columns, rows = (slice(max(0, int(at - radius_px - 2)), max(0, int(at + radius_px + 3))) for at in (u, v))
        part = mask[rows, columns]
        if not part.size:
            continue
        row, column = np.ogrid[rows.start : rows.start + part.shape[0], columns.start : columns.start + part.shape[1]]
        edge = np.sqrt(max(radius_px**2 - 1 / 12, 0)) + 0.5
        np.maximum(part, np.clip(edge - np.hypot(row - v, column - u), 0, 1), out=part)
    blurred = diffracted(mask, blur_px) if sharp else gaussian_filter(mask, blur_px * FINE, truncate=5.0)
    return np.asarray(1 - blurred[FINE // 2 :: FINE, FINE // 2 :: FINE], dtype=np.float64)


def diffracted(mask: np.ndarray[tuple[int, int], np.dtype[np.float32]], core_px: float) -> FloatArray:
    """By diffraction in light from all directions, whose core is as wide as that Gaussian, and by pixels."""
    airy_px = core_px / (0.42 / 2.44)
    down, along = np.fft.fftfreq(mask.shape[0])[:, None] * FINE, np.fft.rfftfreq(mask.shape[1]) * FINE
    share = np.minimum(np.hypot(down, along) * airy_px / 2.44, 1)
    transfer = 2 / np.pi * (np.arccos(share) - share * np.sqrt(1 - share**2)) * np.sinc(down) * np.sinc(along)
    return np.asarray(np.fft.irfft2(np.fft.rfft2(mask) * transfer, mask.shape), dtype=np.float64)


def shadow_scene(
    shape: tuple[int, int, int],
    density_per_mm3: float,
    image_size_px: tuple[int, int],
    *,
    seed: int = 1,
    noise: float = 0.012,
    median_mm: float = 0.04,
    blurs_px: tuple[float, ...] = BLURS_PX,
    sharp: bool = False,
    least_mm: float = 0.01,
) -> ShadowScene:
    """Droplets of lognormal size all over a grid, seen by the paper's views."""
    rng = np.random.default_rng(seed)
    grid, cameras = study_grid(shape), study_cameras(image_size_px)
    count = round(density_per_mm3 * grid.volume_mm3)
    points_mm = grid.to_mm(droplet_centres(shape, count, rng))
    diameters_mm = np.clip(rng.lognormal(np.log(median_mm), 0.4, count), least_mm, 0.3)
    images = []
    for camera, blur_px in zip(cameras, blurs_px, strict=True):
        radii_px = 0.5 * diameters_mm * scale_px_per_mm(camera, points_mm)
        image = united_shadow(camera.project(points_mm), radii_px, blur_px, image_size_px, sharp=sharp)
        images.append((image + rng.normal(0, noise, image.shape)).astype(np.float32))
    return ShadowScene(points_mm, diameters_mm, images, cameras, grid)


def search_of(scene: ShadowScene, margin_voxel: int) -> DropletSearch:
    return plan_droplets(scene.cameras, scene.grid, margin_voxel=margin_voxel)


BITS, DARK, LIGHT = 12, 80.0, 2400.0
"""Of a recorded run, in grey values."""
UNKNOWN = np.s_[:6]
"""Rows of every view whose background is saturated."""


class Shadows(Protocol):
    """Images of any scene with the cameras that see it."""

    @property
    def images(self) -> list[np.ndarray[tuple[int, int], np.dtype[np.float32]]]:
        """Light over that of the background."""

    @property
    def cameras(self) -> list[PinholeCamera]:
        """One per image."""


def write_shadow_run(
    run_dir: Path,
    scene: Shadows,
    *further: Shadows,
    background: bool = True,
    later: Shadows | None = None,
    seen_behind: Sequence[NDArray[Any]] | None = None,
) -> Path:
    """Shots of one exposure before a light that falls off to one side, with its references; ``later`` is exposure B.

    ``seen_behind`` is by view what backgrounds show of the light, if not all.
    """
    names = [f"view{number}" for number in range(1, 5)]
    rows, columns = scene.images[0].shape
    light = np.repeat(np.linspace(LIGHT, 0.7 * LIGHT, columns)[None], rows, axis=0)
    full_scale = 2**BITS - 1
    recorded = ExposureRecord(valid=True, frame_id=1, device_timestamp_ns=1)
    header = RunHeader(
        run_id=run_dir.name,
        created_utc="2026-01-01T00:00:00+00:00",
        views={name: ViewFormat((rows, columns), BITS) for name in names},
        frames_per_shot=2 if later else 1,
        separation_ns=SEPARATION_NS if later else None,
        polarity="shadow",
    )

    def greys(seen: Shadows) -> list[NDArray[np.uint16]]:
        out = [np.clip(np.rint(DARK + light * image), 0, full_scale).astype(np.uint16) for image in seen.images]
        for grey in out:
            grey[UNKNOWN] = full_scale
        return out

    def views(seen: Shadows) -> dict[str, DoubleFrame]:
        second = greys(later) if later else [None] * len(names)
        frames = (DoubleFrame(a, b, recorded, recorded) for a, b in zip(greys(seen), second, strict=True))
        return dict(zip(names, frames, strict=True))

    lit = np.repeat((DARK + light).astype(np.float32)[None], 2 if later else 1, axis=0)
    lit[:, UNKNOWN] = full_scale
    with RunWriter(run_dir, header) as writer:
        if background:
            dark = np.full((len(lit), rows, columns), DARK, np.float32)
            shares = seen_behind or [np.ones((rows, columns))] * len(names)
            backgrounds = {
                name: np.asarray(DARK + share * (lit - DARK), np.float32)
                for name, share in zip(names, shares, strict=True)
            }
            writer.write_references(dict.fromkeys(names, dark), backgrounds)
        for number, seen in enumerate((scene, *further)):
            writer.write_shot(Shot(number, ImageKey.SAMPLE, views(seen)))
        writer.finish("completed")
    return run_dir


def write_shadow_calibration(path: Path, scene: Shadows) -> Path:
    """The scene's cameras as a calibration."""
    good = droplet_calibration(scene.cameras, np.array([3.0, 1.0, 2.0]))
    save_calibration(replace(good, id=content_id(good)), path)
    return path
