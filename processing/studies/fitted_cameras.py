"""How true is a fitted camera? In the box that its target spans, and in the whole volume that is reconstructed.

The paper's target at its ten positions with noise, the principal point off the middle, the lens distorted, and the
sensor tilted as Scheimpflug asks. Beside the error of the fit stands what the best unbiased fit to such points leaves:
no other fit with these parameters does better than that, however clever.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from processing.calibration.calibration import Model
from processing.calibration.fit.covariance import image_spread_px, least_covariance
from processing.calibration.fit.model_choice import fit_mapping
from processing.calibration.observation import PlaneObservation, stacked
from processing.geometry import FloatArray, PinholeCamera, view_camera
from processing.studies.calibration_rows import (
    TARGET,
    TRUE_ERROR_LIMIT_PX,
    CalibrationRow,
    CalibrationStudy,
    error_row,
    rms_px,
)
from processing.synthetic.paper_rig import IMAGE_SCALE_PX_PER_MM, IMAGE_SIZE_PX, TABLE_1

HALF_VOLUME_MM = (9.0, 8.625, 4.5)
"""Half-widths of the paper's reconstruction: a little higher than the target, and less wide."""
DISTORTION = (0.6, 20.0, 8e-4, -6e-4, 0.0)
NODES = (23, 17, 10)
"""Points along x, y and z at which errors are looked at; the outermost are the corners of the region."""
IDEAL_FITS = 400
"""Fits that are drawn from the bound."""


def fitted_cameras(study: CalibrationStudy) -> Iterator[CalibrationRow]:
    """True errors of both camera models in both regions, view by view."""
    regions = regions_mm(study)
    for model, view in product((Model.PINHOLE, Model.PINHOLE_TILTED), study.views):
        camera = tilted_cameras(study, tilted=model is Model.PINHOLE_TILTED)[view]
        fits = [
            fit_mapping(noisy_planes(study, camera, view, number), camera.image_size_px, model)[0]
            for number in range(study.fits)
        ]
        for region, points_mm in regions.items():
            truth_px = camera.project(points_mm)
            error_px = np.linalg.norm([fit.project(points_mm) - truth_px for fit in fits], axis=2)
            ideal_px = ideal_errors_px(study, camera, points_mm, model)
            row = error_row("true error", f"{model.value}, {region}", view, error_px, TRUE_ERROR_LIMIT_PX)
            yield beside_ideal(row, ideal_px, study.fits)


def beside_ideal(row: CalibrationRow, ideal_px: FloatArray, fits: int) -> CalibrationRow:
    """The row of so many fits, and what the best unbiased fits leave, from their errors (fits, N)."""
    largest_px = ideal_px.max(axis=1)
    sets = np.array_split(largest_px, max(1, len(largest_px) // fits))
    return replace(
        row,
        ideal_rms=rms_px(ideal_px),
        ideal_maximum=float(np.mean([one.max() for one in sets])),
        ideal_fits_within=float((largest_px <= row.limit).mean()),
    )


def regions_mm(study: CalibrationStudy) -> dict[str, FloatArray]:
    """Points (N, 3) of the box that the target spans, and of the whole volume, corners included."""
    board_mm = TARGET.points_mm(TARGET.board_ids())
    low_mm, high_mm = np.append(board_mm.min(axis=0), min(study.z_mm)), np.append(board_mm.max(axis=0), max(study.z_mm))
    return {
        "within the target": _lattice_mm(low_mm, high_mm),
        "whole volume": _lattice_mm(-np.array(HALF_VOLUME_MM), np.array(HALF_VOLUME_MM)),
    }


def _lattice_mm(low_mm: FloatArray, high_mm: FloatArray) -> FloatArray:
    axes_mm = [np.linspace(low, high, nodes) for low, high, nodes in zip(low_mm, high_mm, NODES, strict=True)]
    return np.stack(np.meshgrid(*axes_mm, indexing="ij"), axis=-1).reshape(-1, 3)


def ideal_errors_px(study: CalibrationStudy, camera: PinholeCamera, points_mm: FloatArray, model: Model) -> FloatArray:
    """Errors (fits, N) at points (N, 3) of the best unbiased fits to the target under the study's noise."""
    target_mm, _ = stacked(_planes(study, camera))
    covariance = least_covariance(camera, target_mm, model, study.noise_px)
    spread_px = image_spread_px(camera, covariance, points_mm, model)
    deviates = np.random.default_rng(study.seed).normal(size=(spread_px.shape[1], IDEAL_FITS))
    errors_px = (spread_px @ deviates).reshape(len(points_mm), 2, IDEAL_FITS)
    return np.asarray(np.linalg.norm(errors_px, axis=1).T, dtype=np.float64)


def tilted_cameras(study: CalibrationStudy, *, tilted: bool) -> dict[str, PinholeCamera]:
    """The four views with their optical axes off the middle; where tilted, by the Scheimpflug condition."""
    cameras = {}
    for name, row in TABLE_1.items():
        u_px, v_px = study.principal_offset_px
        camera = view_camera(
            row.azimuth_deg,
            focal_length_mm=row.focal_length_mm,
            magnification=row.magnification,
            scale_px_per_mm=IMAGE_SCALE_PX_PER_MM,
            image_size_px=IMAGE_SIZE_PX,
            distortion=np.array(DISTORTION),
            principal_offset_px=(float(np.copysign(u_px, row.azimuth_deg)), v_px),
        )
        scheimpflug_rad = float(np.arctan(row.magnification * np.tan(np.deg2rad(row.azimuth_deg))))
        cameras[name] = replace(camera, tilt_rad=(0.0, scheimpflug_rad)) if tilted else camera
    return cameras


def noisy_planes(study: CalibrationStudy, camera: PinholeCamera, view: str, fit: int) -> list[PlaneObservation]:
    """The target as a view sees it at every position, with normal noise of its own for every fit."""
    rng = np.random.default_rng([study.seed, fit, study.views.index(view)])
    return [
        replace(plane, image_px=plane.image_px + rng.normal(0, study.noise_px, plane.image_px.shape))
        for plane in _planes(study, camera)
    ]


def _planes(study: CalibrationStudy, camera: PinholeCamera) -> list[PlaneObservation]:
    board_mm = TARGET.points_mm(TARGET.board_ids())
    on_planes_mm = [np.column_stack([board_mm, np.full(len(board_mm), z_mm)]) for z_mm in study.z_mm]
    return [
        PlaneObservation(f"z={z_mm:g}", points_mm, camera.project(points_mm), z_mm)
        for z_mm, points_mm in zip(study.z_mm, on_planes_mm, strict=True)
    ]
