"""Shots of droplets seen by the four views of the paper, one of which has moved since it was calibrated."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from processing.calibration.calibration import Calibration, Model, PlaneError, Verdict, ViewCalibration
from processing.calibration.calibration_record import content_id
from processing.calibration.droplet_images import find_droplets
from processing.geometry import FloatArray, PinholeCamera, ViewMapping, view_camera
from processing.synthetic.stamping import Discs, FloatImage, stamp_discs

HALF_MM = np.array([2.5, 2.0, 1.5])
SIZE_PX = (400, 300)
DENSITY_PER_MM3 = 7.0
AZIMUTHS_DEG = (45.0, 15.0, -15.0, -45.0)


def views(azimuths_deg: Sequence[float] = AZIMUTHS_DEG) -> list[PinholeCamera]:
    """Cameras at 60 px/mm, slightly distorted."""
    return [
        view_camera(
            azimuth_deg,
            focal_length_mm=90.0,
            magnification=0.44,
            scale_px_per_mm=60.0,
            image_size_px=SIZE_PX,
            distortion=np.array([0.5, 10.0, 6e-4, -4e-4, 0.0]),
        )
        for azimuth_deg in azimuths_deg
    ]


def picture(camera: PinholeCamera, points_mm: FloatArray, rng: np.random.Generator) -> FloatImage:
    """Blurred droplets of 3 px diameter with noise, bright on black."""
    count = len(points_mm)
    discs = Discs(
        camera.project(points_mm)[:, ::-1],
        np.full(count, 1.5),
        np.full(count, 1.2),
        np.full(count, 0.9),
        np.zeros((count, 2)),
    )
    width_px, height_px = camera.image_size_px
    opacity = 1 - stamp_discs(discs, (height_px, width_px))
    return np.clip(opacity + rng.normal(0, 0.01, opacity.shape), 0, 1).astype(np.float32)


@lru_cache(maxsize=4)
def droplet_shots(
    count: int, density_per_mm3: float = DENSITY_PER_MM3, azimuths_deg: tuple[float, ...] = AZIMUTHS_DEG
) -> tuple[tuple[FloatArray, ...], ...]:
    """Detected droplets by shot and view."""
    rng = np.random.default_rng(7)
    shots = []
    for _ in range(count):
        points_mm = rng.uniform(-HALF_MM, HALF_MM, (int(density_per_mm3 * np.prod(2 * HALF_MM)), 3))
        shots.append(tuple(find_droplets(picture(camera, points_mm, rng)) for camera in views(azimuths_deg)))
    return tuple(shots)


def calibration_of(mappings: Sequence[ViewMapping], model: Model = Model.PINHOLE) -> Calibration:
    """A calibration of the measured volume with these mappings."""
    x_mm, y_mm, z_mm = (float(half_mm) for half_mm in HALF_MM)
    plane = PlaneError(-z_mm, 100, 0.01, 0.01, "low")
    seen = {
        f"view{number}": ViewCalibration(
            mapping,
            model,
            200,
            0.01,
            0.01,
            0.02,
            0.02,
            (plane,),
            Verdict.GOOD,
            extent_mm=((-x_mm, -y_mm), (x_mm, -y_mm), (x_mm, y_mm), (-x_mm, y_mm)),
        )
        for number, mapping in enumerate(mappings, start=1)
    }
    undated = Calibration("", "2026-01-01T00:00:00+00:00", None, seen, (-z_mm, z_mm), "test")
    return undated.with_id(content_id(undated))


def inside_mm(count: int = 300) -> FloatArray:
    """Points all over the measured volume."""
    return np.random.default_rng(3).uniform(-HALF_MM, HALF_MM, (count, 3))
