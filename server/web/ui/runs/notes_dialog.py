"""NotesDialog: notes of a run, nozzle and axis are changed by whoever looks at its page."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from nicegui import ui

from daq.errors import DaqError, ShotFileError
from daq.files.run_directory import RunConditions
from daq.run_notes import RunNotes, Spray
from server.lab.errors import ServerError
from server.lab.runs.notes_change import NewNotes, change_notes
from server.lab.runs.run_summary import ACTIVE, RunSummary
from server.lab.services import Context
from server.lab.starting.command import command
from server.web.ui.draft import NOTES_FIELDS, positions, problem_of
from server.web.ui.runs.run_rows import is_unreadable
from server.web.ui.visiting import told, visitor

_LINES = (("operator", "Operator"), ("fluid", "Fluid"), ("nozzle", "Nozzle"))
_PLACES = (("nozzle_mm", "Orifice at x, y, z / mm"), ("axis", "Axis of the spray x, y, z"))
_LOOK = "dense outlined hide-bottom-space autocomplete=off"


class NotesDialog:
    """Built once per page of a run; opened by its button.

    Parameters
    ----------
    context : Context
        The application.
    run_id : str
        Whose notes they are.
    changed : Callable[[], Awaitable[None]]
        Called once they are changed.
    """

    def __init__(self, context: Context, run_id: str, changed: Callable[[], Awaitable[None]]) -> None:
        self._context, self._run_id, self._changed = context, run_id, changed
        self._more, self._seen = RunNotes().more, 0
        self.button = ui.button("Edit notes...", icon="edit_note", on_click=self._open).props("flat dense no-caps")
        """Opens it."""
        with ui.dialog() as self._dialog, ui.card().props('aria-label="notes of the run"').classes("w-full"):
            ui.label("Notes of this run").classes("text-base font-medium")
            ui.label("The run stays as it was recorded; what stood here before is kept with them.").classes("text-sm")
            self._fields: dict[str, ui.input | ui.number | ui.textarea] = dict(_built_fields())
            self._places = {name: ui.input(label).props(_LOOK).classes("w-full") for name, label in _PLACES}
            self._refusal = ui.label("").classes("refusal").props("role=alert")
            with ui.row().classes("w-full justify-end"):
                ui.button("Leave as they are", on_click=self._dialog.close).props("flat no-caps")
                ui.button("Save notes", on_click=self._save).props("no-caps")

    def show(self, run: RunSummary) -> None:
        """Only notes of a run that is over and can be read are changed."""
        self.button.set_visibility(run.outcome != ACTIVE and not is_unreadable(run))

    async def _open(self) -> None:
        try:
            now, self._seen, flaw = await asyncio.to_thread(self._read)
        except (DaqError, ServerError) as error:
            ui.notify(told(error), type="negative")
            return
        self._more = now.notes.more
        for name, field in self._fields.items():
            field.set_value(getattr(now.notes, name))
        for name, place in self._places.items():
            place.set_value(", ".join(map(str, getattr(now.spray, name))) if now.spray else "")
        self._refusal.set_text(flaw)
        self._dialog.open()

    def _read(self) -> tuple[RunConditions, int, str]:
        """What holds now, how many changes have led there, and why those cannot be read."""
        run = self._context.runs.reader(self._run_id)
        try:
            changes, flaw = run.notes_changes, ""
        except ShotFileError as error:
            changes, flaw = (), str(error)
        return RunConditions.after(run.header, changes), len(changes), flaw

    async def _save(self) -> None:
        if not all([field.validate() for field in self._fields.values()]):
            return
        context, run_id, deed = self._context, self._run_id, f"changed the notes of run {self._run_id}"
        try:
            new, who = NewNotes(notes=self._written(), spray=self._spray(), seen=self._seen), visitor()
            await asyncio.to_thread(
                command, context, who, deed, lambda: change_notes(context.runs, run_id, new, who.name)
            )
        except (DaqError, ServerError, ValueError) as error:
            self._refusal.set_text(told(error))
            return
        self._dialog.close()
        await self._changed()

    def _written(self) -> RunNotes:
        written = {name: field.value for name, field in self._fields.items()}
        said = {name: value for name, value in written.items() if value not in (None, "")}
        return RunNotes.model_validate(said | {"more": self._more})

    def _spray(self) -> Spray | None:
        """As it is written; None where nothing is: it stays as it was."""
        said = {name: positions(place.value) for name, place in self._places.items() if place.value}
        return Spray.model_validate(said) if said else None


def _built_fields() -> list[tuple[str, Any]]:
    lines = [(name, ui.input(label, validation=_problem_of(name))) for name, label in _LINES]
    pressure = ui.number("Pressure / bar", validation=_problem_of("pressure_bar"))
    remark = ui.textarea("Remark", validation=_problem_of("remark"))
    built = [*lines, ("pressure_bar", pressure), ("remark", remark)]
    for _, field in built:
        field.props(_LOOK).classes("w-full")
    return built


def _problem_of(name: str) -> Callable[[Any], str | None]:
    return lambda value: None if value in (None, "") else problem_of(NOTES_FIELDS, name, value)
