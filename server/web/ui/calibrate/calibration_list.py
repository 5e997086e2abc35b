"""CalibrationList: every calibration with its verdict, the newest first; one of them is current."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from nicegui import ui

from processing.calibration.verdict import Verdict
from server.lab.calibration_story import CalibrationStory, story_of
from server.lab.errors import ServerError
from server.lab.jobs.job import JobKind
from server.lab.services import Context
from server.lab.starting.calibrating import use_calibration
from server.web.ui.calibrate.target_runs import UNDER_WAY
from server.web.ui.table import SHOW, table_of
from server.web.ui.theme import panel
from server.web.ui.visiting import told, visitor

COLOURS = {Verdict.GOOD: "positive", Verdict.USABLE: "positive", Verdict.WARN: "warning", Verdict.REFUSE: "negative"}
_USE = "Use"
_NOTHING = "No calibration yet: press Calibrate beside a run above."


class CalibrationList:
    """Built once per page.

    Parameters
    ----------
    context : Context
        Knows the calibrations.
    show : Callable[[str], Awaitable[None]]
        Shows one of them.
    """

    def __init__(self, context: Context, show: Callable[[str], Awaitable[None]]) -> None:
        self._context, self._show = context, show
        self.proposed: str | None = None
        """The one to look at first: the current one, or the newest."""
        with panel("Calibrations"):
            self._refusal = ui.label("").classes("refusal").props('role=alert aria-label="why it is not used"')
            self._nothing = ui.label("").classes("text-sm").props('role=status aria-label="calibrations"')
            self._table = table_of(
                ("name", "Calibration"),
                ("made", "Made"),
                ("outcome", "Verdict"),
                ("worst", "Worst view"),
                ("actions", ""),
            )
            self._table.on("act", self._on_act)

    async def reload(self) -> None:
        """Read the files again."""
        found = await asyncio.to_thread(self._stories)
        jobs = await asyncio.to_thread(self._context.jobs.newest, None, UNDER_WAY, 1, [JobKind.CALIBRATION])
        self._nothing.set_text(_being_made(jobs[0].run_id) if jobs else _NOTHING)
        self._table.rows = [_row(one) for one in found]
        self._table.set_visibility(bool(found))
        self._nothing.set_visibility(bool(jobs) or not found)
        self._table.update()
        current = [one.id for one in found if one.current]
        self.proposed = next(iter([*current, *(one.id for one in found)]), None)

    def _stories(self) -> list[CalibrationStory]:
        """All that can be read; of another one the page of events tells."""
        found = []
        for item in self._context.calibrations.list():
            try:
                found.append(story_of(self._context, item.id))
            except ServerError:
                continue
        return found

    async def _on_act(self, event: Any) -> None:
        self._refusal.set_text("")
        calibration_id = event.args["id"]
        if event.args["action"] == SHOW:
            await self._show(calibration_id)
            return
        try:
            await asyncio.to_thread(use_calibration, self._context, visitor(), calibration_id)
        except ServerError as error:
            self._refusal.set_text(f"{calibration_id} is not used: {told(error)}")
        else:
            ui.notify(f"{calibration_id} is the current calibration", type="positive")


def _being_made(run_id: str) -> str:
    return f"A calibration is being made of {run_id}; it appears here, and is used once you press Use."


def _row(story: CalibrationStory) -> dict[str, Any]:
    return {
        "id": story.id,
        "name": f"{story.id} (current)" if story.current else story.id,
        "made": story.created_utc[:16].replace("T", " "),
        "outcome": story.verdict or "not known",
        "colour": COLOURS.get(story.verdict, "blue-grey-7") if story.verdict else "blue-grey-7",
        "worst": _worst(story),
        "actions": [SHOW] if story.current else [SHOW, _USE],
    }


def _worst(story: CalibrationStory) -> str:
    known = {name: view.holdout_error_px for name, view in story.views.items() if view.holdout_error_px is not None}
    if not known:
        return ""
    worst = max(known, key=lambda name: known[name])
    return f"{worst}: {known[worst]:.3f} px"
