"""OneRunPage: one run: how it went, its shots with their raw frames, its plan, and where it comes from."""

import asyncio
from collections.abc import Mapping
from typing import Any

from nicegui import ui

from daq.errors import ShotFileError
from daq.files.run_directory import RunHeader
from daq.names import is_identifier
from server.lab.errors import NotFound
from server.lab.runs.notes_change import notes_history
from server.lab.runs.run_store import has_results
from server.lab.runs.run_summary import ACTIVE, RunSummary
from server.lab.services import Context
from server.web.ui.drawer.event_log import line_of
from server.web.ui.runs.notes_dialog import NotesDialog
from server.web.ui.runs.removal_dialog import RemovalDialog
from server.web.ui.runs.run_facts import Facts, plan_facts, provenance_facts
from server.web.ui.runs.run_rows import (
    changed_text,
    earlier_text,
    is_unreadable,
    local_time,
    notes_text,
    run_colour,
    shots_text,
)
from server.web.ui.runs.run_work import RunWork
from server.web.ui.runs.runs_page import STYLE_SHEET
from server.web.ui.runs.shot_view import ShotView
from server.web.ui.theme import panel
from server.web.ui.visiting import for_operators, why_not

_EVENTS = 60


class OneRunPage:
    """See ``DeskPage``.

    Parameters
    ----------
    context : Context
        The application.
    run_id, shot : str
        As the address of the page has them; a shot that is no number is the first one.
    """

    def __init__(self, context: Context, run_id: str, shot: str) -> None:
        ui.add_css(STYLE_SHEET)
        self._context, self._run_id = context, run_id
        self._first_shot = int(shot) if shot.isascii() and shot.isdigit() else 0
        self._shots: ShotView | None = None
        self._is_built = False
        self._page = ui.element("div").classes("columns one")

    async def refresh(self) -> None:
        """Shots come by the list; nobody changes or deletes a run while somebody else holds control."""
        if self._is_built:
            for control in (self._edit.button, self._delete):
                for_operators(control, why=why_not(self._context))

    async def reload(self) -> None:
        """Read the run again."""
        try:
            run = await asyncio.to_thread(self._context.runs.summary, self._run_id)
            there = await asyncio.to_thread(self._context.runs.directory, self._run_id)
        except NotFound as error:
            self._tell_unknown(str(error))
            return
        if not self._is_built:
            self._build(run, await asyncio.to_thread(self._header))
        self._tell(run)
        self._earlier.set_text(await asyncio.to_thread(self._earlier_notes) if run.notes_changed_utc else "")
        self._work.show(run)
        self._results.set_visibility(await asyncio.to_thread(has_results, there))
        await self._work.reload()
        if self._shots:
            await self._shots.reload()

    def _header(self) -> RunHeader | None:
        try:
            return self._context.runs.reader(self._run_id).header
        except ShotFileError:
            return None

    def _earlier_notes(self) -> str:
        try:
            return earlier_text(notes_history(self._context.runs, self._run_id).changes)
        except (NotFound, ShotFileError) as error:
            return str(error)

    def _tell_unknown(self, text: str) -> None:
        self._page.clear()
        self._is_built, self._shots = False, None
        with self._page, panel("Run"):
            why = ": it was deleted, moved away, or its address is wrong" if is_identifier(self._run_id) else ""
            ui.label(f"{text}{why}.").classes("empty-state")
            ui.link("All runs", "/runs")

    def _build(self, run: RunSummary, header: RunHeader | None) -> None:
        self._page.clear()
        self._is_built = True
        with self._page:
            with panel("Run"):
                self._build_head()
                self._work = RunWork(self._context)
            if not is_unreadable(run):
                self._shots = ShotView(self._context, self._run_id, self._first_shot, self._on_shot)
            with ui.element("div").classes("two-panels"):
                if header:
                    _facts("Plan", plan_facts(header))
                    _facts("Provenance", provenance_facts(header))
                with panel("Events"):
                    self._events = ui.label("").classes("text-xs whitespace-pre-line")

    def _build_head(self) -> None:
        with ui.element("div").classes("run-head"):
            ui.link("All runs", "/runs").classes("text-sm")
            ui.label(self._run_id).classes("text-base font-medium")
            self._outcome = ui.badge("").props('aria-label="outcome"')
            self._told = ui.label("").classes("text-sm").props('role=status aria-label="about the run"')
            ui.space()
            self._results = ui.link("Results", f"/results/{self._run_id}").classes("text-sm")
            self._edit = NotesDialog(self._context, self._run_id, self.reload)
            dialog = RemovalDialog(self._context, self._run_id)
            self._delete = ui.button("Delete...", icon="delete", on_click=dialog.open)
            self._delete.props("flat dense no-caps color=negative")
        self._cause = ui.label("").classes("text-sm whitespace-pre-line").props('role=status aria-label="cause"')
        self._notes = ui.label("").classes("text-sm opacity-80").props('role=status aria-label="notes"')
        self._earlier = ui.label("").classes("text-xs opacity-70 whitespace-pre-line")
        self._earlier.props('role=status aria-label="what stood in them before"')

    def _tell(self, run: RunSummary) -> None:
        self._outcome.set_text(run.outcome)
        self._outcome.props(f"color={run_colour(run)}")
        shots = shots_text(run)
        valid = shots if run.outcome == ACTIVE or not shots else f"valid shots: {shots}"
        named = [f"calibration {run.calibration}"] if run.calibration else []
        named += [f"references {', '.join(run.references)}"] if run.references else []
        told = (run.kind or "", local_time(run.created_utc), valid, *named)
        self._told.set_text(" · ".join(text for text in told if text))
        self._cause.set_text(
            "\n".join(text for text in (run.cause, run.remedy and f"What to do: {run.remedy}") if text)
        )
        self._cause.set_visibility(bool(run.cause))
        self._notes.set_text(" · ".join(text for text in (notes_text(run), changed_text(run)) if text))
        self._edit.show(run)
        lines = [line_of(event) for event in self._context.services.events.since(0) if _is_of(event.data, self._run_id)]
        told_lines = [line for line in lines if line][-_EVENTS:]
        self._events.set_text("\n".join(told_lines) or "None since the server was started; causes of before are above.")

    def _on_shot(self, shot: int) -> None:
        ui.navigate.history.replace(f"/runs/{self._run_id}/shots/{shot}")


def _is_of(data: Mapping[str, Any], run_id: str) -> bool:
    return data.get("run_id") == run_id


def _facts(title: str, facts: Facts) -> None:
    with panel(title), ui.element("dl").classes("run-facts"):
        for name, value in facts:
            with ui.element("dt"):
                ui.label(name)
            with ui.element("dd"):
                ui.label(value)
