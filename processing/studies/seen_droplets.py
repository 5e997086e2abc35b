"""Droplets as distorted views see them and as the product finds them: what self-calibration works on."""

from collections.abc import Sequence

import numpy as np

from processing.calibration.calibration import Calibration, Model, PlaneError, ViewCalibration
from processing.calibration.calibration_record import content_id
from processing.calibration.droplets.droplet_images import find_droplets
from processing.calibration.verdict import Verdict
from processing.geometry import FloatArray, PinholeCamera, ViewMapping, view_camera
from processing.studies.simulated_droplets import AZIMUTHS_DEG, SCALE_VOXEL_PER_MM
from processing.synthetic.stamping import Discs, FloatImage, stamp_discs

RADIUS_PX, BLUR_PX, OPACITY, NOISE = 1.5, 1.2, 0.9, 0.01
DISTORTION = (0.5, 10.0, 6e-4, -4e-4, 0.0)


def droplet_views(image_size_px: tuple[int, int], azimuths_deg: Sequence[float] = AZIMUTHS_DEG) -> list[PinholeCamera]:
    """Cameras at 60 px/mm, slightly distorted."""
    return [
        view_camera(
            azimuth_deg,
            focal_length_mm=90.0,
            magnification=0.44,
            scale_px_per_mm=SCALE_VOXEL_PER_MM,
            image_size_px=image_size_px,
            distortion=np.array(DISTORTION),
        )
        for azimuth_deg in azimuths_deg
    ]


def droplet_image(camera: PinholeCamera, points_mm: FloatArray, rng: np.random.Generator) -> FloatImage:
    """Blurred droplets of 3 px diameter at points (N, 3), with noise, bright on black."""
    count = len(points_mm)
    discs = Discs(
        camera.project(points_mm)[:, ::-1],
        np.full(count, RADIUS_PX),
        np.full(count, BLUR_PX),
        np.full(count, OPACITY),
        np.zeros((count, 2)),
    )
    width_px, height_px = camera.image_size_px
    opacity = 1 - stamp_discs(discs, (height_px, width_px))
    return np.clip(opacity + rng.normal(0, NOISE, opacity.shape), 0, 1).astype(np.float32)


def seen_droplets(
    cameras: Sequence[PinholeCamera], half_mm: FloatArray, density_per_mm3: float, rng: np.random.Generator
) -> tuple[FloatArray, ...]:
    """One shot of droplets all over the box of half-widths (3,): those that each view finds, (N, 2) each."""
    points_mm = rng.uniform(-half_mm, half_mm, (int(density_per_mm3 * np.prod(2 * half_mm)), 3))
    return tuple(find_droplets(droplet_image(camera, points_mm, rng)) for camera in cameras)


def droplet_calibration(
    mappings: Sequence[ViewMapping], half_mm: FloatArray, model: Model = Model.PINHOLE
) -> Calibration:
    """A good calibration of the box of half-widths (3,) with these mappings, ``view1`` and so on."""
    x_mm, y_mm, z_mm = (float(one_mm) for one_mm in half_mm)
    plane = PlaneError("low", -z_mm, 100, 0.01, 0.01)
    outline_mm = ((-x_mm, -y_mm), (x_mm, -y_mm), (x_mm, y_mm), (-x_mm, y_mm))
    views = {
        f"view{number}": ViewCalibration(
            verdict=Verdict.GOOD,
            model=model,
            n_points=200,
            n_rejected=0,
            mean_error_px=0.01,
            rms_px=0.01,
            max_error_px=0.02,
            holdout_error_px=0.02,
            mapping=mapping,
            extent_mm=outline_mm,
            boards_in_free_poses=(),
            planes=(plane,),
        )
        for number, mapping in enumerate(mappings, start=1)
    }
    undated = Calibration("", "2026-01-01T00:00:00+00:00", None, views, (-z_mm, z_mm), "simulated droplets")
    return undated.with_id(content_id(undated))
