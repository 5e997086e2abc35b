"""Cameras that have moved since they were calibrated: what the watch sees of it, and what self-calibration leaves.

Droplets of the spray itself tell. The watch looks at a single shot, as ``tomoshadow check`` does, so that many single
shots are asked; self-calibration takes several together. Every view is moved in a direction of its own.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from processing.calibration.calibration import Calibration
from processing.calibration.droplets.disparity import ViewDisparity, measured_box, shot_disparity
from processing.calibration.droplets.self_calibration import self_calibrate
from processing.calibration.errors import CalibrationError
from processing.calibration.fit.health import LIMITS_PX
from processing.calibration.verdict import Verdict
from processing.geometry import FloatArray, PinholeCamera
from processing.studies.calibration_rows import DRIFT_LIMIT_PX, CalibrationRow, CalibrationStudy, rms_px
from processing.studies.seen_droplets import droplet_calibration, droplet_views, seen_droplets
from processing.studies.simulated_droplets import SCALE_VOXEL_PER_MM

WATCHED_PX = 0.4
"""A drift that the watch must raise an alarm for, and its error must not hide."""
ALARM_PX = LIMITS_PX[Verdict.USABLE]
DISPARITY_LIMIT_PX = WATCHED_PX - ALARM_PX

Shot = Sequence[FloatArray]
"""Droplets (N, 2) of every view."""


@dataclass(frozen=True)
class _Rig:
    """Four views, their calibration, and points (N, 3) all over the volume."""

    cameras: list[PinholeCamera]
    calibration: Calibration
    points_mm: FloatArray

    @classmethod
    def of(cls, study: CalibrationStudy) -> "_Rig":
        half_mm = np.array(study.half_mm)
        cameras = droplet_views(_image_size_px(half_mm))
        points_mm = np.random.default_rng(study.seed).uniform(-half_mm, half_mm, (1000, 3))
        return cls(cameras, droplet_calibration(cameras, half_mm), points_mm)

    def number_of(self, view: str) -> int:
        return list(self.calibration.views).index(view)


def drifting_views(study: CalibrationStudy) -> Iterator[CalibrationRow]:
    """What the watch misses of a drift, and what self-calibration leaves of one, density by density."""
    rig = _Rig.of(study)
    for density_per_mm3 in study.densities_per_mm3:
        rng, case = np.random.default_rng(study.seed), f"{density_per_mm3:g} droplets/mm3"
        count = max(study.shots, study.watched_shots)
        shots = [seen_droplets(rig.cameras, np.array(study.half_mm), density_per_mm3, rng) for _ in range(count)]
        yield from _watched(rig, shots[: study.watched_shots], study.views, case)
        for view in study.views:
            shift_px = study.drift_px * direction(rig.number_of(view))
            yield _recovered(rig, shots[: study.shots], view, shift_px, case)


def direction(number: int) -> FloatArray:
    """Unit vector (u, v) in which a view moves: another one than those of the views before it, by the golden angle."""
    angle_rad = np.deg2rad(137.5 * number - 45)
    return np.array([np.cos(angle_rad), np.sin(angle_rad)])


def _watched(rig: _Rig, shots: Sequence[Shot], views: Sequence[str], case: str) -> Iterator[CalibrationRow]:
    """Disparities of shot after shot: with all views in place, and with one off, the views taking turns."""
    in_place = [_disparities(rig, shot) for shot in shots]
    for turn, view in enumerate(views):
        number = rig.number_of(view)
        off = [
            _disparities(rig, moved)[number]
            for moved in _moved(shots[turn :: len(views)], number, WATCHED_PX * direction(number))
        ]
        yield _watched_row(f"{case}, in place", view, [shot[number] for shot in in_place], 0.0)
        yield _watched_row(f"{case}, off by {WATCHED_PX:g} px", view, off, WATCHED_PX)


def _disparities(rig: _Rig, shot: Shot) -> Sequence[ViewDisparity]:
    """Of every view in one shot; infinite where the droplets do not tell."""
    try:
        return shot_disparity(rig.cameras, [shot], measured_box(rig.calibration))
    except CalibrationError:
        return [ViewDisparity(np.inf, 0.0)] * len(rig.cameras)


def _watched_row(case: str, view: str, measured: Sequence[ViewDisparity], drift_px: float) -> CalibrationRow:
    """By how much the disparities of single shots differ from a drift; each must raise an alarm, or none may."""
    error_px = np.abs([shot.disparity_px - drift_px for shot in measured])
    if not np.all(np.isfinite(error_px)):
        return CalibrationRow("disparity error", case, view, None, None, DISPARITY_LIMIT_PX, kept=False)
    alarmed = np.array([shot.certain_px > ALARM_PX for shot in measured])
    value_px, largest_px = rms_px(error_px), float(error_px.max())
    kept = value_px < DISPARITY_LIMIT_PX and bool(np.all(alarmed == (drift_px > ALARM_PX)))
    return CalibrationRow("disparity error", case, view, value_px, largest_px, DISPARITY_LIMIT_PX, kept)


def _recovered(rig: _Rig, shots: Sequence[Shot], view: str, shift_px: FloatArray, case: str) -> CalibrationRow:
    """What is left of a drift anywhere in the volume, in any view."""
    number = rig.number_of(view)
    try:
        found = self_calibrate(rig.calibration, _moved(shots, number, shift_px), "study").calibration
    except CalibrationError:
        return CalibrationRow("drift error", case, view, None, None, DRIFT_LIMIT_PX, kept=False)
    truth_px = [camera.project(rig.points_mm) for camera in rig.cameras]
    truth_px[number] = truth_px[number] + shift_px
    error_px = [
        np.linalg.norm(one.mapping.project(rig.points_mm) - seen_px, axis=1)
        for one, seen_px in zip(found.views.values(), truth_px, strict=True)
    ]
    largest_px = float(np.max(error_px))
    kept = largest_px <= DRIFT_LIMIT_PX
    return CalibrationRow("drift error", case, view, rms_px(error_px[number]), largest_px, DRIFT_LIMIT_PX, kept)


def _moved(shots: Sequence[Shot], number: int, shift_px: FloatArray) -> list[list[FloatArray]]:
    return [[seen + shift_px if view == number else seen for view, seen in enumerate(shot)] for shot in shots]


def _image_size_px(half_mm: FloatArray) -> tuple[int, int]:
    """Image in which every view sees the whole box of half-widths (3,), with a margin for perspective."""
    x_mm, y_mm, z_mm = 2.2 * half_mm
    return round(SCALE_VOXEL_PER_MM * float(np.hypot(x_mm, z_mm))), round(SCALE_VOXEL_PER_MM * float(y_mm))
