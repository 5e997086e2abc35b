"""Cameras and point sets that the tests of calibration share."""

from collections.abc import Sequence

import numpy as np

from processing.calibration.observation import CalibrationSet, PlaneObservation, ViewObservations
from processing.calibration.target.targets import Target
from processing.geometry import FloatArray, PinholeCamera, ViewMapping, view_camera

TARGET = Target(kind="checkerboard", columns=23, rows=17, pitch_mm=1.0)
Z_MM = tuple(np.linspace(-4.5, 4.5, 10))


def paper_camera(
    azimuth_deg: float = 45.0,
    principal_offset_px: tuple[float, float] = (250.0, -100.0),
    distortion: tuple[float, ...] = (0.6, 20.0, 8e-4, -6e-4, 0.0),
) -> PinholeCamera:
    """A view of the paper, its principal point far from the image centre."""
    return view_camera(
        azimuth_deg,
        focal_length_mm=100.0,
        magnification=0.45,
        scale_px_per_mm=60.0,
        principal_offset_px=principal_offset_px,
        distortion=np.array(distortion),
    )


def target_plane_mm(z_mm: float, columns: int = 23, rows: int = 17) -> FloatArray:
    x, y = np.meshgrid(np.arange(columns) - columns // 2, np.arange(rows) - rows // 2)
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z_mm)]).astype(np.float64)


def seen_planes(
    camera: PinholeCamera, z_mm: Sequence[float] = Z_MM, noise_px: float = 0.05, seed: int = 0, **board: int
) -> tuple[PlaneObservation, ...]:
    """The target at positions of the stage, with noise per coordinate."""
    rng = np.random.default_rng(seed)
    planes = []
    for z in z_mm:
        points_mm = target_plane_mm(z, **board)
        image_px = camera.project(points_mm) + rng.normal(0, noise_px, (len(points_mm), 2))
        planes.append(PlaneObservation(f"z={z:g}", points_mm, image_px, float(z)))
    return tuple(planes)


def calibration_set(**planes: tuple[PlaneObservation, ...]) -> CalibrationSet:
    """A set of views from their planes."""
    return CalibrationSet("test", TARGET, {name: ViewObservations((1600, 1200), seen) for name, seen in planes.items()})


def volume_points_mm(n: int = 4000, seed: int = 9) -> FloatArray:
    """Points all over the measurement volume of the paper."""
    return np.random.default_rng(seed).uniform([-9, -8.6, -4.5], [9, 8.6, 4.5], (n, 3))


def true_errors_px(mapping: ViewMapping, camera: PinholeCamera) -> FloatArray:
    """Distance between a fitted mapping and the truth, all over the volume."""
    points_mm = volume_points_mm()
    return np.asarray(np.linalg.norm(mapping.project(points_mm) - camera.project(points_mm), axis=1), dtype=np.float64)
