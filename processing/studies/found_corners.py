"""How well are corners found? The paper's board, rendered with blur, noise and uneven light, against the truth."""

import time
from collections.abc import Iterator

import cv2
import numpy as np

from processing.calibration.target.targets import detect_target
from processing.studies.calibration_rows import (
    CORNER_LIMIT_PX,
    CORNER_LIMIT_S,
    PHOTOGRAPHS,
    TARGET,
    CalibrationRow,
    CalibrationStudy,
    Photograph,
    error_row,
)
from processing.synthetic.paper_rig import paper_cameras, paper_optics
from processing.synthetic.stamping import FloatImage
from processing.synthetic.target import Checkerboard, render_target


def found_corners(study: CalibrationStudy) -> Iterator[CalibrationRow]:
    """Errors of corners and time per image, view by view and photograph by photograph."""
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
            yield CalibrationRow("corner time", case, view, seconds, None, CORNER_LIMIT_S, seconds < CORNER_LIMIT_S)


def _photograph(clear: FloatImage, how: Photograph, rng: np.random.Generator) -> FloatImage:
    """12-bit image of a board; blur as given, light that falls off to one corner, noise."""
    blurred = cv2.GaussianBlur(clear, (0, 0), how.blur_px) if how.blur_px else clear
    v, u = np.mgrid[0 : 1 : clear.shape[0] * 1j, 0 : 1 : clear.shape[1] * 1j]
    light = 1 - how.unevenness * (u * u + v * v) / 2
    image = rng.normal(3000 * light * blurred + 100, 4095 * how.noise)
    return np.asarray(np.clip(np.rint(image), 0, 4095), dtype=np.float32)
