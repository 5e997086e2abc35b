"""How accurate is a calibration? Against truth that only a simulation has, each figure beside its limit.

Cameras: see ``fitted_cameras``. Corners: the paper's board rendered with blur, noise and uneven light, against where
they truly are. Cameras that have moved: see ``drifting_views``.
"""

import time
from collections.abc import Iterator

import cv2
import numpy as np

from processing.calibration.target.targets import detect_target
from processing.studies.accuracy_study import (
    CORNER_LIMIT_PX,
    CORNER_LIMIT_S,
    PHOTOGRAPHS,
    TARGET,
    AccuracyRow,
    CalibrationStudy,
    Photograph,
    error_row,
)
from processing.studies.drifting_views import drifting_views
from processing.studies.fitted_cameras import fitted_cameras
from processing.synthetic.paper_rig import paper_cameras, paper_optics
from processing.synthetic.stamping import FloatImage
from processing.synthetic.target import Checkerboard, render_target


def calibration_study(study: CalibrationStudy | None = None) -> Iterator[AccuracyRow]:
    """Measure view by view; the same study gives the same errors (times differ)."""
    study = study or CalibrationStudy()
    yield from fitted_cameras(study)
    yield from _found_corners(study)
    yield from drifting_views(study)


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
