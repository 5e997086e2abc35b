"""CalibrationStory: what a calibration file says, in the words of somebody who has to decide about it."""

from collections.abc import Mapping, Sequence
from statistics import median
from typing import Annotated, Any

from pydantic import Field, ValidationError

from daq.frozen_model import FrozenModel
from processing.calibration.verdict import Verdict
from server.lab.errors import Damaged
from server.lab.services import Context

_STANDS_OUT = 2.0
"""A plane with so many times the error of the others has a fault of its own."""


class PlaneFigures(FrozenModel):
    """Residuals of one view on one plane."""

    name: Annotated[str, Field(description="of the plane, or where it is")]
    mean_error_px: Annotated[float, Field(description="of the points that were used")]
    holdout_error_px: Annotated[float | None, Field(description="of points that the fit had not seen")]


class ViewFigures(FrozenModel):
    """How well one view is calibrated."""

    verdict: Annotated[Verdict | None, Field(description="what it is good for")]
    model: Annotated[str, Field(description="of its camera")]
    holdout_error_px: Annotated[float | None, Field(description="of points that the fit had not seen")]
    n_points: Annotated[int, Field(description="that were used")]
    n_rejected: Annotated[int, Field(description="that were left out as wrong")]
    reasons: Annotated[tuple[str, ...], Field(description="why the verdict is not better")]
    planes: Annotated[tuple[PlaneFigures, ...], Field(description="from the first to the last")]

    @property
    def worst_plane(self) -> str:
        """Where it is worst; empty where no plane is known."""
        return max(self.planes, key=lambda plane: plane.mean_error_px).name if self.planes else ""


class CalibrationStory(FrozenModel):
    """One calibration."""

    id: Annotated[str, Field(description="name of its file")]
    current: Annotated[bool, Field(description="it is used for runs that name none")]
    created_utc: Annotated[str, Field(description="when it was made, ISO 8601; empty: nobody knows")]
    source: Annotated[str, Field(description="run or images that it was made from")]
    verdict: Annotated[Verdict | None, Field(description="of its worst view; null: nobody knows")]
    views: Annotated[dict[str, ViewFigures], Field(description="by name")]
    remedy: Annotated[str, Field(description="what would make it better; empty: nothing is known to")]
    notes: Annotated[tuple[str, ...], Field(description="what it was made by, and what was not checked")]
    pictures: Annotated[tuple[str, ...], Field(description="names of pictures that were drawn of it")]


def story_of(context: Context, calibration_id: str) -> CalibrationStory:
    """Read one calibration; NotFound if there is none, Damaged if nobody can read it."""
    document = context.calibrations.document(calibration_id)
    try:
        return _story(context, calibration_id, document)
    except (ValidationError, AttributeError, KeyError, TypeError) as error:
        raise Damaged(f"{context.calibrations.path(calibration_id)}: is no calibration: {error}") from error


def _story(context: Context, calibration_id: str, document: Mapping[str, Any]) -> CalibrationStory:
    store = context.calibrations
    views = {name: _view(one) for name, one in (document.get("views") or {}).items()}
    verdicts = [view.verdict for view in views.values() if view.verdict]
    unchecked = [f"not checked: {one['what']}" for one in document.get("not_checked", ())]
    return CalibrationStory(
        id=calibration_id,
        current=store.current == calibration_id,
        created_utc=document.get("created_utc", ""),
        source=document.get("source", ""),
        verdict=max(verdicts, key=list(Verdict).index, default=None),
        views=views,
        remedy=remedy_of(views),
        notes=(*document.get("notes", ()), *unchecked),
        pictures=store.pictures(calibration_id),
    )


def remedy_of(views: Mapping[str, ViewFigures]) -> str:
    """What would make a calibration better: the plane that stands out, or the first reason of the worst view."""
    for name, view in sorted(views.items(), key=lambda one: -_worst_px(one[1])):
        errors = sorted(plane.mean_error_px for plane in view.planes)
        if len(errors) > 1 and errors[-1] > _STANDS_OUT * median(errors[:-1]):
            return (
                f"record the target at {view.worst_plane} again: {name} misses it by {errors[-1]:.2f} px on average, "
                f"other planes by {errors[-2]:.2f} px or less"
            )
    doubted = [(name, view) for name, view in views.items() if view.reasons]
    return "; ".join(f"{name}: {view.reasons[0]}" for name, view in doubted)


def refusals_of_use(context: Context, calibration_id: str) -> Sequence[str]:
    """Why nothing can be reconstructed with a calibration; empty: it can. Old runs may have had other cameras."""
    story = story_of(context, calibration_id)
    return [
        f"{name} is refused: {'; '.join(view.reasons) or 'its errors are too large'}"
        for name, view in story.views.items()
        if view.verdict is Verdict.REFUSE
    ]


def misfits(context: Context, calibration_id: str) -> list[str]:
    """Views whose camera delivers other images than the calibration is made for; those that are alike together."""
    sizes_px = context.calibrations.image_sizes_px(calibration_id)
    alike: dict[tuple[tuple[int, int], tuple[int, int]], list[str]] = {}
    for view, camera in context.services.rig.cameras.items():
        rows, columns = camera.image_shape
        made_for = sizes_px.get(view, (columns, rows))
        if made_for != (columns, rows):
            alike.setdefault((made_for, (columns, rows)), []).append(view)
    return [
        f"{calibration_id!r} is made for images of {width} x {height} px of {', '.join(views)}, "
        f"not of {columns} x {rows} px"
        for ((width, height), (columns, rows)), views in alike.items()
    ]


def _worst_px(view: ViewFigures) -> float:
    return max((plane.mean_error_px for plane in view.planes), default=0.0)


def _view(stored: Mapping[str, Any]) -> ViewFigures:
    return ViewFigures(
        verdict=stored.get("verdict"),
        model=stored.get("model", ""),
        holdout_error_px=stored.get("holdout_error_px"),
        n_points=stored.get("n_points", 0),
        n_rejected=stored.get("n_rejected", 0),
        reasons=tuple(stored.get("reasons", ())),
        planes=tuple(_plane(one) for one in stored.get("planes", ())),
    )


def _plane(stored: Mapping[str, Any]) -> PlaneFigures:
    z_mm = stored.get("z_mm")
    figures = {name: stored.get(name) for name in PlaneFigures.model_fields}
    return PlaneFigures.model_validate({**figures, "name": stored["name"] if z_mm is None else f"z = {z_mm:.3f} mm"})
