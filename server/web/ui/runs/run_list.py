"""RunList: all runs page by page, found by kind, outcome, words and results."""

import asyncio
from collections.abc import Mapping
from typing import Any

from nicegui import ui

from daq.run_plan import RunKind
from server.lab.runs.run_filter import MOST_TEXT, ListedOutcome, RunFilter
from server.lab.services import Context
from server.web.ui.runs.run_rows import run_row
from server.web.ui.table import table_of
from server.web.ui.theme import panel

PAGE = 50
_COLUMNS = {
    "picture": "",
    "time": "Time",
    "id": "Run",
    "kind": "Kind",
    "shots": "Valid / planned",
    "outcome": "Outcome",
    "calibration": "Calibration",
    "references": "References",
}
_PICTURE = """<q-td :props="props" auto-width><img v-if="props.value" :src="props.value" class="run-picture"
loading="lazy" alt="" @error="$event.target.style.visibility = 'hidden'"></q-td>"""
_NAME = """<q-td :props="props">
<a class="run-link" :href="'/runs/' + encodeURIComponent(props.value)">{{ props.value }}</a>
<div class="run-more">{{ props.row.notes }}</div></q-td>"""
_OUTCOME = """<q-td :props="props"><q-badge :color="props.row.colour" :label="props.value" />
<div class="run-more">{{ props.row.cause }}</div>
<div v-if="props.row.remedy" class="run-more remedy">Do: {{ props.row.remedy }}</div></q-td>"""
_ANY = "any"
_RESULTS = {_ANY: "any results", True: "with results", False: "without results"}
_NO_RUN = "There is no run yet. Record the first one on the page Run, or bring images in by: tomoshadow import"
_NO_MATCH = "No run is like that: ask for less."


class RunList:
    """Built once per page; a row leads to the page of its run."""

    def __init__(self, context: Context) -> None:
        self._runs = context.runs
        self._offset = 0
        with panel("Runs", "flex-1"):
            with ui.row().classes("w-full items-center gap-3 run-filter"):
                self._text = ui.input("Search id, name, notes, cause", on_change=self._from_the_first)
                self._text.props(
                    f'dense outlined clearable debounce=300 maxlength={MOST_TEXT} aria-label="search runs"'
                )
                self._text.classes("run-search")
                self._kind = self._choice("kind", {_ANY: "any kind"} | {kind: kind.value for kind in RunKind})
                outcomes = {_ANY: "any outcome"} | {outcome: outcome.value for outcome in ListedOutcome}
                self._outcome = self._choice("outcome", outcomes)
                self._results = self._choice("results", _RESULTS)
                ui.space()
                self._count = ui.label("").classes("text-sm").props('role=status aria-label="runs shown"')
                self._newer = ui.button(icon="chevron_left", on_click=lambda: self._turn(-PAGE))
                self._older = ui.button(icon="chevron_right", on_click=lambda: self._turn(PAGE))
                for button, label in ((self._newer, "newer runs"), (self._older, "older runs")):
                    button.props(f'flat dense round aria-label="{label}"')
            self._empty = ui.label("").classes("empty-state")
            self._table = table_of(*_COLUMNS.items())
            for column, slot in (("picture", _PICTURE), ("id", _NAME), ("outcome", _OUTCOME)):
                self._table.add_slot(f"body-cell-{column}", slot)

    async def reload(self) -> None:
        """Read the page that is shown again."""
        wanted = self._wanted()
        runs, count = await asyncio.to_thread(self._runs.page, PAGE, self._offset, wanted)
        self._table.rows = [run_row(run) for run in runs]
        self._table.update()
        self._table.set_visibility(bool(runs))
        self._count.set_text(f"{self._offset + 1} to {self._offset + len(runs)} of {count}" if runs else "")
        self._newer.set_enabled(self._offset > 0)
        self._older.set_enabled(self._offset + PAGE < count)
        self._empty.set_text("" if runs else _NO_RUN if wanted.takes_all else _NO_MATCH)
        self._empty.set_visibility(not runs)

    def _wanted(self) -> RunFilter:
        asked = {"kind": self._kind.value, "outcome": self._outcome.value, "results": self._results.value}
        return RunFilter.model_validate(
            {"text": (self._text.value or "")[:MOST_TEXT]} | {name: one for name, one in asked.items() if one != _ANY}
        )

    async def _from_the_first(self) -> None:
        self._offset = 0
        await self.reload()

    async def _turn(self, by: int) -> None:
        self._offset = max(0, self._offset + by)
        await self.reload()

    def _choice(self, label: str, options: Mapping[Any, str]) -> ui.select:
        choice = ui.select(dict(options), value=_ANY, on_change=self._from_the_first)
        return choice.props(f'dense outlined options-dense aria-label="{label} of runs"')
