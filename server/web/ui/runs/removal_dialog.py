"""RemovalDialog: a run is deleted by whoever types its name."""

import asyncio
from functools import partial

from nicegui import ui

from daq.errors import DaqError
from server.lab.errors import ServerError
from server.lab.runs.run_removal import remove_run
from server.lab.services import Context
from server.lab.starting.command import command
from server.web.ui.visiting import told, visitor


class RemovalDialog:
    """Built once per page of a run; opened by its button."""

    def __init__(self, context: Context, run_id: str) -> None:
        self._context, self._run_id = context, run_id
        with ui.dialog() as self._dialog, ui.card().props('aria-label="delete run"'):
            ui.label("Delete this run for ever, with its results?").classes("text-base font-medium")
            self._used = ui.label("").classes("text-sm")
            ui.label(f"Type its name to delete it: {run_id}").classes("text-sm")
            self._typed = ui.input("Name of the run", on_change=self._judge).props("outlined dense autocomplete=off")
            self._typed.classes("w-full")
            self._refusal = ui.label("").classes("refusal").props("role=alert")
            with ui.row().classes("w-full justify-end"):
                ui.button("Keep it", on_click=self._dialog.close).props("flat no-caps")
                self._button = ui.button("Delete", on_click=self._remove).props("no-caps color=negative")
        self._judge()

    async def open(self) -> None:
        """Ask."""
        self._typed.value = ""
        self._refusal.set_text("")
        self._dialog.open()
        self._used.set_text("")
        referring = await asyncio.to_thread(self._context.runs.referring_to, self._run_id)
        if referring:
            named = ", ".join(referring[:3]) + (f" and {len(referring) - 3} more" if len(referring) > 3 else "")
            self._used.set_text(f"It is a reference of {named}: they hold their own means of its images, and stay.")

    def _judge(self) -> None:
        self._button.set_enabled(self._typed.value == self._run_id)

    async def _remove(self) -> None:
        context, run_id = self._context, self._run_id
        remove = partial(remove_run, context.runs, context.unkept_runs, context.jobs, run_id, self._typed.value)
        try:
            await asyncio.to_thread(command, context, visitor(), f"deleted run {run_id}", remove)
        except (DaqError, ServerError) as error:
            self._refusal.set_text(told(error))
            return
        self._dialog.close()
        ui.notify(f"{self._run_id} is deleted", type="positive")
        ui.navigate.to("/runs")
