"""Volume self-calibration (Wieneke 2008): droplets in the shots themselves tell which view has moved.

Droplets say how the views stand to each other, not to the world: any motion of all views together is invisible.
Two rules keep the world where the target put it. If the motion of a single view explains the disparities, and of
no other view as well, that view moved and the others did not. Otherwise all views are moved as little as possible.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np

from processing.calibration.calibration import Calibration, ViewCalibration
from processing.calibration.calibration_record import content_id
from processing.calibration.droplets.disparity import (
    SEARCH_PX,
    LocalDisparity,
    against_others,
    local_disparities,
    measured_box,
    require_views,
)
from processing.calibration.droplets.droplet_matching import Box, match_exposures
from processing.calibration.droplets.mapping_correction import corrected, correction_size, sensitivity
from processing.calibration.droplets.motion_fit import FAINTEST, largest_uncertainty_px, places_mm, solve
from processing.calibration.errors import CalibrationError
from processing.calibration.fit.health import judge
from processing.calibration.triangulation import linearise, unseen
from processing.calibration.verdict import Doubt, is_of_shot, worse
from processing.geometry import FloatArray, ViewMapping

DIVISIONS = ((3, 3, 3), (2, 2, 2))
"""Sub-volumes along x, y and z; larger ones where droplets are too dense for a peak in small ones."""
MIN_SUB_VOLUMES = 8
"""Fewer do not show how a correction varies over the volume."""
MAX_UNCERTAINTY_PX = 0.06
"""Standard uncertainty of a correction, where it is largest; its error is to stay below 0.1 px."""
CROWDED_PX = 12.0
"""Where the droplets that are found are closer to each other than this, on average, many more hide each other."""
FINE_SEARCH_PX = 1.5
"""Tolerance once the views were corrected for the first time."""
MAX_ROUNDS = 5
CONVERGED_PX = 0.01
AGREED_PX = 0.05
"""Views that disagree by less are left as they are: a good calibration has this error."""
EXPLAINED_PX = 0.1
"""A motion that leaves less than this explains the disparities."""
CLEARER = 2.0
"""The view that moved leaves so many times less than any other view would."""
NOISE_PX = 0.02
"""Disparity of a sub-volume that may be left by chance."""


@dataclass(frozen=True)
class SelfCalibration:
    """What became of it.

    Parameters
    ----------
    calibration : Calibration
        The new calibration; names its parent.
    corrections_px : dict[str, float]
        By view: largest distance in the volume between the old and the new mapping.
    moved : str | None
        The view that moved, if a single one did.
    before_px, after_px : dict[str, float]
        By view: rms distance from where the other views put the droplets, over the sub-volumes.
    sub_volumes : int
        Sub-volumes whose droplets told.
    droplets : int
        Droplets in their peaks.
    uncertainty_px : float
        Largest standard uncertainty of the corrections, anywhere in the volume; 0 if nothing moved.
    """

    calibration: Calibration
    corrections_px: dict[str, float]
    moved: str | None
    before_px: dict[str, float]
    after_px: dict[str, float]
    sub_volumes: int
    droplets: int
    uncertainty_px: float


def self_calibrate(
    calibration: Calibration, exposures: Sequence[Sequence[FloatArray]], source: str, *, created_utc: str | None = None
) -> SelfCalibration:
    """Correct the views of a calibration by the droplets of several exposures.

    Parameters
    ----------
    calibration : Calibration
        At least three views that see a common volume.
    exposures : sequence of sequences of (N, 2) arrays
        By exposure: the droplets of every view, in the order of the views of the calibration.
    source : str
        Run that the shots are from.
    created_utc : str, optional
        ISO 8601; now, if not given.

    Raises
    ------
    CalibrationError
        Droplets are too few, do not agree or leave the correction uncertain; names numbers and limits.
    """
    calibration.require_world()
    require_views(len(calibration.views))
    original, box = [view.mapping for view in calibration.views.values()], measured_box(calibration)
    first = _sub_volumes(original, exposures, box, SEARCH_PX)
    moved, mappings, last = _refined(original, exposures, box, first)
    distances_px, after_px = _distances_px(original, mappings, box), _disagreement_px(mappings, last)
    corrections = dict(zip(calibration.views, distances_px, strict=True))
    uncertainty_px = largest_uncertainty_px(mappings, np.flatnonzero(distances_px), last, box)
    _require_certain(uncertainty_px, last)
    note = f"self-calibration on {len(exposures)} exposures of {source}: {_moves(corrections)}"
    views = {
        name: _corrected_view(view, mapping, distance_px, left_px)
        for (name, view), mapping, distance_px, left_px in zip(
            _as_calibrated(calibration.views, distances_px).items(), mappings, distances_px, after_px, strict=True
        )
    }
    return SelfCalibration(
        calibration=_child(calibration, views, note, created_utc),
        corrections_px=corrections,
        moved=None if moved is None else list(calibration.views)[moved],
        before_px=dict(zip(calibration.views, _disagreement_px(original, first), strict=True)),
        after_px=dict(zip(calibration.views, after_px, strict=True)),
        sub_volumes=len(last),
        droplets=sum(disparity.n_droplets for disparity in last),
        uncertainty_px=uncertainty_px,
    )


def _require_certain(uncertainty_px: float, seen: Sequence[LocalDisparity]) -> None:
    if uncertainty_px > MAX_UNCERTAINTY_PX:
        droplets = sum(disparity.n_droplets for disparity in seen)
        raise CalibrationError(
            f"{droplets} droplets in {len(seen)} sub-volumes leave the correction uncertain by "
            f"{uncertainty_px:.2f} px, at most {MAX_UNCERTAINTY_PX:g} px are allowed: "
            "take more shots, or shots of a thinner spray"
        )


def _refined(
    original: Sequence[ViewMapping],
    exposures: Sequence[Sequence[FloatArray]],
    box: Box,
    seen: Sequence[LocalDisparity],
) -> tuple[int | None, list[ViewMapping], Sequence[LocalDisparity]]:
    """The view that moved, if a single one did; the corrected mappings; and what the droplets say of these."""
    moved, mappings = None, list(original)
    for _ in range(MAX_ROUNDS):
        moved, corrections = _explain(original, mappings, seen)
        previous, mappings = mappings, [corrected(*pair) for pair in zip(original, corrections, strict=True)]
        seen = _sub_volumes(mappings, exposures, box, FINE_SEARCH_PX)
        if max(_distances_px(previous, mappings, box)) < CONVERGED_PX:
            break
    return moved, mappings, seen


def _moves(corrections_px: Mapping[str, float]) -> str:
    """Which views were moved, for a person."""
    moves = ", ".join(f"{name} by {px:.2f} px" for name, px in corrections_px.items() if px)
    return moves or "the views agree, nothing moved"


def _child(
    parent: Calibration, views: Mapping[str, ViewCalibration], note: str, created_utc: str | None
) -> Calibration:
    """A calibration that names its parent."""
    undated = replace(
        parent,
        id="",
        created_utc=created_utc or datetime.now(UTC).isoformat(timespec="seconds"),
        views=views,
        parent=parent.id,
        notes=(*parent.notes, note),
    )
    return undated.with_id(content_id(undated))


def _sub_volumes(
    mappings: Sequence[ViewMapping], exposures: Sequence[Sequence[FloatArray]], box: Box, tolerance_px: float
) -> list[LocalDisparity]:
    matches = match_exposures(mappings, exposures, box, tolerance_px)
    seen: list[LocalDisparity] = []
    for divisions in DIVISIONS:
        seen = max(seen, local_disparities(mappings, matches, box, divisions), key=len)
        if len(seen) >= MIN_SUB_VOLUMES:
            return seen
    per_view = np.mean([[len(points) for points in droplets_px] for droplets_px in exposures], axis=0)
    raise CalibrationError(
        f"droplets agree in {len(seen)} of {np.prod(DIVISIONS[0])} sub-volumes, {MIN_SUB_VOLUMES} are needed: "
        f"{len(exposures)} exposures with {', '.join(f'{count:.0f}' for count in per_view)} droplets by view give "
        f"{len(matches)} combinations within {tolerance_px:g} px; {_advice(mappings, exposures, box)}"
    )


def _advice(mappings: Sequence[ViewMapping], exposures: Sequence[Sequence[FloatArray]], box: Box) -> str:
    """What would help: the distance of neighbouring droplets in the fullest view tells."""
    corners_mm = np.array(np.meshgrid(*zip(box.lower_mm, box.upper_mm, strict=True))).reshape(3, -1).T
    sizes_px = [np.ptp(mapping.project(corners_mm), axis=0) for mapping in mappings]
    counts = np.mean([[len(points) for points in droplets_px] for droplets_px in exposures], axis=0)
    apart_px = min(float(np.sqrt(size.prod() / max(count, 1))) for size, count in zip(sizes_px, counts, strict=True))
    if apart_px < CROWDED_PX:
        return (
            f"droplets are {apart_px:.1f} px apart on average and hide each other; below {CROWDED_PX:g} px few are "
            "seen alone: take many more shots, or shots of a thinner spray (lower pressure, start of the injection)"
        )
    return "take more shots; if the spray is thin enough, a view has moved further than 3 px: calibrate again"


def _explain(
    original: Sequence[ViewMapping], current: Sequence[ViewMapping], seen: Sequence[LocalDisparity]
) -> tuple[int | None, list[FloatArray]]:
    """The view that moved, if a single one did, and the corrections of the original mappings."""
    points_mm = np.array([disparity.point_mm for disparity in seen])
    projector = unseen(np.stack([linearise(mapping, points_mm)[1] for mapping in original], axis=1))
    changed_px = np.stack(
        [now.project(points_mm) - then.project(points_mm) for now, then in zip(current, original, strict=True)], axis=1
    )
    measured_px = np.array([disparity.disparity_px for disparity in seen]) + changed_px
    target_px = (projector @ measured_px.reshape(len(seen), -1, 1))[..., 0]
    blocks = [
        projector[:, :, 2 * view : 2 * view + 2] @ sensitivity(mapping, points_mm)
        for view, mapping in enumerate(original)
    ]
    none = [np.zeros(correction_size(mapping)) for mapping in original]
    if _rms_px(target_px) < AGREED_PX:
        return None, none
    alone = [solve(block, target_px, 0.0) for block in blocks]
    left_px = [_rms_px(target_px - block @ correction) for block, correction in zip(blocks, alone, strict=True)]
    best, second = np.argsort(left_px)[:2]
    if left_px[best] < EXPLAINED_PX and left_px[second] > CLEARER * max(left_px[best], NOISE_PX):
        return int(best), [*none[:best], alone[best], *none[best + 1 :]]
    together = solve(np.concatenate(blocks, axis=2), target_px, FAINTEST)
    return None, np.split(together, np.cumsum([len(part) for part in none])[:-1])


def _rms_px(disparity_px: FloatArray) -> float:
    """Root mean square length of disparities, given as (sub-volumes, 2 n)."""
    return float(np.sqrt(2 * np.mean(disparity_px**2)))


def _disagreement_px(mappings: Sequence[ViewMapping], seen: Sequence[LocalDisparity]) -> list[float]:
    squared = [
        ((against_others(mappings, one.point_mm) @ one.disparity_px[:, :, None]) ** 2).sum(axis=(1, 2)) for one in seen
    ]
    return [float(value) for value in np.sqrt(np.mean(squared, axis=0))]


def _distances_px(before: Sequence[ViewMapping], after: Sequence[ViewMapping], box: Box) -> list[float]:
    points_mm = places_mm(box)
    return [
        float(np.linalg.norm(new.project(points_mm) - old.project(points_mm), axis=1).max())
        for old, new in zip(before, after, strict=True)
    ]


def _corrected_view(view: ViewCalibration, mapping: ViewMapping, distance_px: float, left_px: float) -> ViewCalibration:
    """A view on its new mapping; what droplets then still disagree by counts as its hold-out error, if larger."""
    if distance_px == 0:
        return view
    holdout_px = max(view.holdout_error_px, left_px)
    corrected = replace(view, mapping=mapping, holdout_error_px=holdout_px, covariance=None)
    left = Doubt((), f"droplets disagree by {left_px:.2g} px after the correction", judge(holdout_px))
    agrees = worse(corrected.verdict, left.verdict) is corrected.verdict
    return corrected if agrees else corrected.doubted(left)


def _as_calibrated(views: Mapping[str, ViewCalibration], distances_px: Sequence[float]) -> dict[str, ViewCalibration]:
    """Views without what droplets have said against them, once any view is corrected: they are asked anew."""
    return {name: _of_target(view) if any(distances_px) else view for name, view in views.items()}


def _of_target(view: ViewCalibration) -> ViewCalibration:
    """A view with what its target says alone."""
    reasons = tuple(reason for reason in view.reasons if not is_of_shot(reason))
    if reasons == view.reasons:
        return view
    rejected = view.n_rejected / max(1, view.n_rejected + view.n_points)
    return replace(view, reasons=reasons, verdict=view.verdict if reasons else judge(view.holdout_error_px, rejected))
