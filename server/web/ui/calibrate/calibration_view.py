"""CalibrationView: one calibration: verdicts and reasons by view, residuals by plane, what to do, its pictures."""

import asyncio
from collections.abc import Mapping
from urllib.parse import quote

from nicegui import ui
from nicegui.events import ValueChangeEventArguments

from processing.calibration.fit.health import LIMITS_PX, judge
from server.lab.calibration_story import CalibrationStory, ViewFigures, story_of
from server.lab.errors import ServerError
from server.lab.services import Context
from server.web.ui.calibrate.calibration_list import COLOURS
from server.web.ui.table import table_of
from server.web.ui.theme import panel

_TITLES = {"errors": "Error vectors", "residuals": "Residuals"}


class CalibrationView:
    """Built once per page."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._shown: CalibrationStory | None = None
        with panel("Calibration"):
            self._box = ui.column().classes("w-full gap-2")

    async def reload(self, proposed: str | None) -> None:
        """Read the shown one again; where none is shown, this one."""
        wanted = self._shown.id if self._shown else proposed
        if wanted:
            await self.show(wanted)
        else:
            self._box.clear()
            with self._box:
                ui.label("Nothing to show yet.").classes("text-sm")

    async def show(self, calibration_id: str) -> None:
        """Show one."""
        try:
            story = await asyncio.to_thread(story_of, self._context, calibration_id)
        except ServerError as error:
            self._tell(f"{calibration_id} cannot be read: {error}")
            return
        if story == self._shown:
            return
        self._shown = story
        self._box.clear()
        with self._box:
            _show_head(story)
            _show_views(story.views)
            _show_planes(story.views)
            _show_pictures(story)

    def _tell(self, text: str) -> None:
        self._shown = None
        self._box.clear()
        with self._box:
            ui.label(text).classes("refusal")


def _show_head(story: CalibrationStory) -> None:
    with ui.row().classes("items-center gap-2"):
        ui.label(story.id).classes("text-base font-medium").style("overflow-wrap:anywhere")
        if story.verdict:
            ui.badge(story.verdict, color=COLOURS[story.verdict]).props('aria-label="verdict"')
        if story.current:
            ui.badge("current", color="primary")
    ui.label(_made(story)).classes("text-xs opacity-70")
    if story.remedy:
        ui.label(f"To do better: {story.remedy}").props('role=status aria-label="remedy"').classes(
            "text-sm font-medium"
        )
    for note in story.notes:
        ui.label(note).classes("text-xs opacity-70")


def _made(story: CalibrationStory) -> str:
    """When, and of what, as far as its file says so."""
    when = (
        f"made {story.created_utc[:16].replace('T', ' ')} UTC"
        if story.created_utc
        else "its file does not say when it was made"
    )
    return f"{when}, of {story.source}" if story.source else f"{when}; of which images is not known"


def _show_views(views: Mapping[str, ViewFigures]) -> None:
    table = table_of(
        ("view", "View"),
        ("outcome", "Verdict"),
        ("model", "Camera"),
        ("holdout", "Hold-out / px"),
        ("points", "Points (left out)"),
        ("worst", "Worst plane"),
        ("detail", "Why not better"),
    )
    table.rows = [
        {
            "id": name,
            "view": name,
            "outcome": view.verdict or "not known",
            "colour": COLOURS[view.verdict] if view.verdict else "blue-grey-7",
            "model": view.model.replace("_", " "),
            "holdout": "" if view.holdout_error_px is None else f"{view.holdout_error_px:.4f}",
            "points": f"{view.n_points} ({view.n_rejected})",
            "worst": view.worst_plane,
            "detail": "; ".join(view.reasons),
        }
        for name, view in views.items()
    ]
    table.set_visibility(bool(views))


def _show_planes(views: Mapping[str, ViewFigures]) -> None:
    """Mean residual of every view on every plane, coloured by the limits of a verdict."""
    planes = list(dict.fromkeys(plane.name for view in views.values() for plane in view.planes))
    if not planes:
        return
    errors = {name: {plane.name: plane.mean_error_px for plane in view.planes} for name, view in views.items()}
    ui.label("Mean residual by plane and view / px").classes("text-sm font-medium")
    with ui.element("table").classes("residuals").props('aria-label="residuals by plane and view"'):
        with ui.element("tr"):
            for head in ("plane", *views):
                with ui.element("th"):
                    ui.label(head)
        for plane in planes:
            with ui.element("tr"):
                with ui.element("th"):
                    ui.label(plane)
                for name in views:
                    _show_cell(errors[name].get(plane))
    good, usable, warn = LIMITS_PX.values()
    ui.label(
        f"No colour: at most {good:g} px, the aim. Yellow: at most {usable:g} px, still usable. "
        f"Orange: at most {warn:g} px. Red: more."
    ).classes("text-xs opacity-70")


def _show_cell(error_px: float | None) -> None:
    with ui.element("td").classes("" if error_px is None else f"residual {judge(error_px)}"):
        ui.label("" if error_px is None else f"{error_px:.3f}")


def _show_pictures(story: CalibrationStory) -> None:
    grids = sorted((name for name in story.pictures if name.startswith("grid-")), key=lambda name: int(name[5:]))
    shown = {name: _TITLES[name] for name in _TITLES if name in story.pictures}
    shown |= {name: f"Corners, plane {name[5:]}" for name in grids if name[5:].isdecimal()}
    if not shown:
        return
    with ui.column().classes("w-full gap-1"):
        choice = ui.select(shown, value=next(iter(shown)), label="Picture").props("dense outlined options-dense")
        picture = ui.element("img").classes("w-full calibration-picture").props('alt="picture of the calibration"')
        picture.props["src"] = _address(story.id, choice.value)

    def turn(event: ValueChangeEventArguments[str]) -> None:
        picture.props["src"] = _address(story.id, event.value)
        picture.update()

    choice.classes("w-64").on_value_change(turn)


def _address(calibration_id: str, picture: str) -> str:
    return f"/api/calibrations/{quote(calibration_id)}/pictures/{picture}.png"
