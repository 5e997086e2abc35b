"""calibrate: all points of a view in one joint 3-D fit, judged by points it has not seen -> Calibration."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.calibration.calibration import Calibration, Model, ViewCalibration
from processing.calibration.calibration_record import content_id
from processing.calibration.errors import UNFIT, CalibrationError
from processing.calibration.fit.covariance import parameter_covariance
from processing.calibration.fit.free_pose import board_errors_px, fit_free_poses, free_pose_holdout_px
from processing.calibration.fit.handedness import check_handedness
from processing.calibration.fit.health import (
    check_motion,
    check_seen_motion,
    errors_px,
    holdout_distances_px,
    judge,
    outline_mm,
    plane_error,
    shortfalls,
)
from processing.calibration.fit.model_choice import AUTO, fit_mapping, holdout_by_model, simplest_that_holds
from processing.calibration.fit.not_checked import not_checked
from processing.calibration.fit.placement_check import check_placements
from processing.calibration.fit.plane_order import check_plane_order
from processing.calibration.fit.ray_check import check_rays, rays_miss_px
from processing.calibration.fit.reach_check import check_reach
from processing.calibration.fit.scale_check import check_scales
from processing.calibration.observation import CalibrationSet, PlaneObservation, ViewObservations, stacked
from processing.calibration.verdict import Doubt
from processing.geometry import FloatArray, PinholeCamera, ViewMapping
from processing.progress import Counted, in_silence

MOST_HOLDOUT_PX, MOST_STRETCH = 5.0, 4.0
"""Points that a camera misses by more, while its pixels are so far from square, are those of no camera."""
PLACEHOLDERS = 3
"""So many wrong points on one spot of the image stand for points that were not seen."""


def calibrate(
    calibration_set: CalibrationSet,
    model: Model | str = Model.PINHOLE,
    *,
    created_utc: str | None = None,
    counted: Counted = in_silence,
) -> Calibration:
    """Fit the camera of every view and judge it.

    Parameters
    ----------
    calibration_set : CalibrationSet
        Detected points.
    model : Model | str
        One joint fit per view: ``pinhole``, ``pinhole_tilted`` or ``polynomial``; or ``auto``: each view gets the
        simplest of them unless another predicts unseen points clearly better (boards in free poses: ``pinhole``).
    created_utc : str, optional
        ISO 8601; now, if not given.
    counted : Counted
        Told of the views, one by one.

    Raises
    ------
    CalibrationError
        Views cannot be calibrated, or cannot belong to one world; names each of them, value and limit.
    """
    views = _all_views(calibration_set, None if model == AUTO else Model(model), counted)
    placed = not any(view.intrinsics_only for view in views.values())
    disordered = list(check_plane_order(calibration_set, views)) if placed else []
    undirected = check_handedness(calibration_set, views) if placed and not disordered else []
    if placed:
        missed_px = rays_miss_px(calibration_set.views, {name: view.mapping for name, view in views.items()})
        views = {name: replace(view, rays_miss_px=missed_px.get(name)) for name, view in views.items()}
    shapeless = [name for name, view in views.items() if not isinstance(view.mapping, PinholeCamera)]
    undated = Calibration(
        id="",
        created_utc=created_utc or datetime.now(UTC).isoformat(timespec="seconds"),
        target=calibration_set.target,
        views=views,
        z_range_mm=_common_z_range_mm(calibration_set),
        source=calibration_set.source,
        notes=calibration_set.notes,
        not_checked=tuple(not_checked(calibration_set, undirected, shapeless)) if placed else (),
    ).doubted(disordered or (_doubts(calibration_set, views) if placed else ()))
    return undated.with_id(content_id(undated))


def _all_views(calibration_set: CalibrationSet, wanted: Model | None, counted: Counted) -> dict[str, ViewCalibration]:
    """Every view, or what is wrong with all of those that are bad: who mends one should not meet the next one after."""
    views, problems = {}, []
    for name, seen in counted(list(calibration_set.views.items()), lambda view: f"camera of {view[0]}"):
        try:
            views[name] = _free_view(seen, wanted) if seen.free_pose else _placed_view(name, seen, wanted)
        except (np.linalg.LinAlgError, cv2.error):
            problems.append(f"{name}: {UNFIT}")
        except CalibrationError as error:
            problem = str(error) if str(error).startswith(name) else f"{name}: {error}"
            problems += [problem, *(note for note in calibration_set.notes if note.startswith(f"{name},"))]
    if problems:
        raise CalibrationError("; ".join(problems))
    return views


def _doubts(calibration_set: CalibrationSet, views: Mapping[str, ViewCalibration]) -> Sequence[Doubt]:
    """What speaks against views that fit their own points; a view that is wrong tells nothing of where others reach."""
    doubts = [
        *check_scales(calibration_set, views),
        *check_placements(calibration_set, {name: view.mapping for name, view in views.items()}),
        *check_rays(views),
    ]
    return doubts or list(check_reach(views, _common_z_range_mm(calibration_set)))


def _placed_view(name: str, seen: ViewObservations, wanted: Model | None) -> ViewCalibration:
    """Fit the model that is wanted; None: all models, and the one to keep."""
    check_motion(name, seen.planes)
    if wanted is not None:
        return _fitted_view(seen, wanted)
    distances_px = holdout_by_model(seen.planes, seen.image_size_px)
    chosen = _fitted_view(seen, simplest_that_holds(distances_px))
    errors_by_model_px = {model: float(px.mean()) for model, px in distances_px.items()}
    return replace(chosen, candidates_holdout_error_px=errors_by_model_px)


def _is_no_camera(view: ViewCalibration) -> bool:
    """Whether points fit so badly, by so strange a camera, that they are those of another target."""
    if not isinstance(view.mapping, PinholeCamera) or view.holdout_error_px < MOST_HOLDOUT_PX:
        return False
    height_to_width = float(view.mapping.camera_matrix[0, 0] / view.mapping.camera_matrix[1, 1])
    return not 1 / MOST_STRETCH < height_to_width < MOST_STRETCH


def _fitted_view(seen: ViewObservations, model: Model) -> ViewCalibration:
    mapping, used = fit_mapping(seen.planes, seen.image_size_px, model)
    masks = [_counted(mask) for mask in _by_plane(seen.planes, used)]
    planes = [plane.select(mask) for plane, mask in zip(seen.planes, masks, strict=True)]
    points_mm, image_px = (values[used] for values in stacked(seen.planes))
    check_seen_motion(mapping, points_mm, image_px)
    holdout_px = holdout_distances_px(planes, lambda training: fit_mapping(training, seen.image_size_px, model)[0])
    errors = [errors_px(mapping, plane) for plane in planes]
    n_rejected = len(used) - sum(len(plane) for plane in planes)
    summary = _summary(mapping, model, planes, errors, holdout_px, n_rejected, extent_mm=outline_mm(planes))
    if _is_no_camera(summary):
        raise CalibrationError(UNFIT)
    return replace(
        summary,
        covariance=parameter_covariance(mapping, points_mm, image_px, model),
        reasons=(*summary.reasons, *_placeholders(stacked(seen.planes)[1][~used])),
    )


def _placeholders(wrong_px: FloatArray) -> Iterator[str]:
    """Wrong points (N, 2) that lie on one spot of the image: tables write so what was not seen."""
    spots_px, counts = np.unique(wrong_px, axis=0, return_counts=True)
    for (u, v), count in zip(spots_px, counts, strict=True):
        if count >= PLACEHOLDERS:
            yield f"{count} points that were left out lie on one spot ({u:g}, {v:g}): were these not seen?"


def _free_view(seen: ViewObservations, wanted: Model | None) -> ViewCalibration:
    if wanted not in (None, Model.PINHOLE):
        raise CalibrationError(f"boards in free poses give a pinhole camera, not {wanted}")
    if not all(plane.free_pose for plane in seen.planes):
        raise CalibrationError("some planes have z_mm, others have not: give all of them or none")
    fitted = fit_free_poses(seen.planes, seen.image_size_px)
    errors = [
        board_errors_px(fitted.camera, board, pose) for board, pose in zip(seen.planes, fitted.poses, strict=True)
    ]
    holdout_px = free_pose_holdout_px(seen.planes, seen.image_size_px)
    summary = _summary(fitted.camera, Model.PINHOLE, list(seen.planes), errors, holdout_px, 0, extent_mm=())
    return replace(summary, boards_in_free_poses=fitted.poses)


def _summary(
    mapping: ViewMapping,
    model: Model,
    planes: list[PlaneObservation],
    errors: list[FloatArray],
    holdout_px: list[FloatArray],
    n_rejected: int,
    extent_mm: tuple[tuple[float, float], ...],
) -> ViewCalibration:
    distances_px, holdout_error_px = np.concatenate(errors), float(np.concatenate(holdout_px).mean())
    return ViewCalibration(
        verdict=judge(holdout_error_px, n_rejected / (n_rejected + len(distances_px))),
        model=model,
        n_points=len(distances_px),
        n_rejected=n_rejected,
        mean_error_px=float(distances_px.mean()),
        rms_px=float(np.sqrt((distances_px**2).mean())),
        max_error_px=float(distances_px.max()),
        holdout_error_px=holdout_error_px,
        mapping=mapping,
        extent_mm=extent_mm,
        boards_in_free_poses=(),
        reasons=shortfalls(holdout_error_px, n_rejected, len(distances_px)),
        planes=tuple(plane_error(*one) for one in zip(planes, errors, holdout_px, strict=True)),
    )


def _counted(used: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Points of a plane that its error counts: a plane of which most points are wrong is itself wrong, and shows it."""
    return np.ones_like(used) if 2 * used.sum() < len(used) else used


def _by_plane(planes: Sequence[PlaneObservation], mask: NDArray[np.bool_]) -> list[NDArray[np.bool_]]:
    return np.split(mask, np.cumsum([len(plane) for plane in planes])[:-1])


def _common_z_range_mm(calibration_set: CalibrationSet) -> tuple[float, float]:
    """Range that every view is calibrated for; (0, 0) where the world is not known."""
    if any(seen.free_pose for seen in calibration_set.views.values()):
        return (0.0, 0.0)
    depths_mm = [stacked(seen.planes)[0][:, 2] for seen in calibration_set.views.values()]
    return float(max(z.min() for z in depths_mm)), float(min(z.max() for z in depths_mm))
