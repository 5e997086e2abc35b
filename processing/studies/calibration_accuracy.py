"""How accurate is a calibration? Against truth that only a simulation has, each figure beside its limit.

Cameras: see ``fitted_cameras``. Corners: the paper's board rendered with blur, noise and uneven light, against where
they truly are. Drift: droplets of the spray itself tell of a camera that has moved by 2 px.
"""

import time
from collections.abc import Iterator

import cv2
import numpy as np

from processing.calibration.errors import CalibrationError
from processing.calibration.self_calibration import self_calibrate
from processing.calibration.targets import detect_target
from processing.geometry import FloatArray
from processing.studies.accuracy_study import (
    CORNER_LIMIT_PX,
    CORNER_LIMIT_S,
    DRIFT_LIMIT_PX,
    PHOTOGRAPHS,
    TARGET,
    AccuracyRow,
    CalibrationStudy,
    Photograph,
    error_row,
    rms_px,
)
from processing.studies.fitted_cameras import fitted_cameras
from processing.studies.seen_droplets import droplet_calibration, droplet_views, seen_droplets
from processing.studies.simulated_droplets import SCALE_VOXEL_PER_MM
from processing.synthetic.paper_rig import paper_cameras, paper_optics
from processing.synthetic.stamping import FloatImage
from processing.synthetic.target import Checkerboard, render_target


def calibration_study(study: CalibrationStudy | None = None) -> Iterator[AccuracyRow]:
    """Measure view by view; the same study gives the same errors (times differ)."""
    study = study or CalibrationStudy()
    yield from fitted_cameras(study)
    yield from _found_corners(study)
    yield from _recovered_drifts(study)


def _found_corners(study: CalibrationStudy) -> Iterator[AccuracyRow]:
    board = Checkerboard(TARGET.columns or 0, TARGET.rows or 0, TARGET.pitch_mm)
    for number, view in enumerate(study.views):
        camera = paper_cameras(study.binning)[view]
        z_mm = (max(study.z_mm), min(study.z_mm))[number % 2]  # the ends of the range, where focus is worst
        clear = render_target(camera, board, z_mm, paper_optics(study.binning)[view])
        for case in study.photographs:
            image = _photograph(clear, PHOTOGRAPHS[case], np.random.default_rng([study.seed, number]))
            started_s = time.process_time()
            points = detect_target(image, TARGET)
            seconds = time.process_time() - started_s
            world_mm = np.column_stack([TARGET.points_mm(points.ids), np.full(len(points), z_mm)])
            error_px = np.linalg.norm(points.image_px - camera.project(world_mm), axis=1)
            yield error_row("corner error", case, view, error_px, CORNER_LIMIT_PX)
            yield AccuracyRow("corner time", case, view, seconds, None, CORNER_LIMIT_S, seconds < CORNER_LIMIT_S)


def _photograph(clear: FloatImage, how: Photograph, rng: np.random.Generator) -> FloatImage:
    """12-bit image of a board; blur as given, light that falls off to one corner, noise."""
    blurred = cv2.GaussianBlur(clear, (0, 0), how.blur_px) if how.blur_px else clear
    v, u = np.mgrid[0 : 1 : clear.shape[0] * 1j, 0 : 1 : clear.shape[1] * 1j]
    light = 1 - how.unevenness * (u * u + v * v) / 2
    image = rng.normal(3000 * light * blurred + 100, 4095 * how.noise)
    return np.asarray(np.clip(np.rint(image), 0, 4095), dtype=np.float32)


def _recovered_drifts(study: CalibrationStudy) -> Iterator[AccuracyRow]:
    half_mm = np.array(study.half_mm)
    cameras = droplet_views(_image_size_px(half_mm))
    calibration = droplet_calibration(cameras, half_mm)
    points_mm = np.random.default_rng(study.seed).uniform(-half_mm, half_mm, (1000, 3))
    for density_per_mm3 in study.densities_per_mm3:
        rng = np.random.default_rng(study.seed)
        shots = [seen_droplets(cameras, half_mm, density_per_mm3, rng) for _ in range(study.shots)]
        for name in study.views:
            moved, case = list(calibration.views).index(name), f"{density_per_mm3:g} droplets/mm3"
            shifts_px = np.zeros((len(cameras), 2))
            shifts_px[moved] = drift_px(study, moved)
            drifted = [[seen + shift for seen, shift in zip(shot, shifts_px, strict=True)] for shot in shots]
            try:
                found = self_calibrate(calibration, drifted, "study").calibration
            except CalibrationError:
                yield AccuracyRow("drift error", case, name, None, None, DRIFT_LIMIT_PX, kept=False)
                continue
            error_px = [
                np.linalg.norm(view.mapping.project(points_mm) - camera.project(points_mm) - shift, axis=1)
                for view, camera, shift in zip(found.views.values(), cameras, shifts_px, strict=True)
            ]
            largest_px = float(np.max(error_px))
            kept = largest_px <= DRIFT_LIMIT_PX
            yield AccuracyRow("drift error", case, name, rms_px(error_px[moved]), largest_px, DRIFT_LIMIT_PX, kept)


def drift_px(study: CalibrationStudy, number: int) -> FloatArray:
    """How far (u, v) a view is moved: in another direction than the views before it, by the golden angle."""
    angle_rad = np.deg2rad(137.5 * number - 45)
    return study.drift_px * np.array([np.cos(angle_rad), np.sin(angle_rad)])


def _image_size_px(half_mm: FloatArray) -> tuple[int, int]:
    """Image in which every view sees the whole box of half-widths (3,), with a margin for perspective."""
    x_mm, y_mm, z_mm = 2.2 * half_mm
    return round(SCALE_VOXEL_PER_MM * float(np.hypot(x_mm, z_mm))), round(SCALE_VOXEL_PER_MM * float(y_mm))
