"""ResultChoice: run, result set, shot: what is looked at, chosen by hand or always the newest."""

import asyncio
from collections.abc import Awaitable, Callable
from urllib.parse import quote

from nicegui import ui

from server.lab.errors import NotFound
from server.lab.jobs.job import JobKind, JobState
from server.lab.results import ResultSet
from server.lab.runs.run_summary import RunSummary
from server.lab.services import Context
from server.web.ui.results.looked_at import (
    LookedAt,
    first_of,
    label_of,
    newest,
    nothing_text,
    runs_with_results,
    sets_of,
    shots_of,
)
from server.web.ui.results.slice_group import FreeSlider
from server.web.ui.theme import panel

NO_RESULTS = (
    "Nothing has been made of any run yet. Choose a calibration on the page Calibrate and record a run of kind sample: "
    "its shots are reconstructed by themselves. Or open a run on the page Runs, and press Reconstruct."
)
_FOLLOWING = "/results"
_UNDER_WAY = (JobState.QUEUED, JobState.RUNNING)
_MAKING = (JobKind.RECONSTRUCTION, JobKind.MEASUREMENT)


class ResultChoice:
    """Built once per page.

    Parameters
    ----------
    context : Context
        The application.
    asked : tuple of str
        Run, result set and shot of the address; empty where it does not say.
    on_look : Callable
        Awaited when something else is looked at; what is the same as before is not told again.
    """

    def __init__(self, context: Context, asked: tuple[str, str, str], on_look: Callable[[], Awaitable[None]]) -> None:
        self._context, self._on_look = context, on_look
        self.run_id, self._results_id, shot = asked
        self._shot = int(shot) if shot.isascii() and shot.isdigit() else None
        self._address = ""
        self.sets: list[ResultSet] = []
        with panel("Result"):
            self._build()

    def _build(self) -> None:
        with ui.element("div").classes("choice-row"):
            self._run = ui.select({}, label="Run", with_input=True, on_change=self._choose_run)
            self._set = ui.select({}, label="Result set", on_change=self._choose_set)
            for choice in (self._run, self._set):
                choice.props("dense outlined options-dense").classes("choice")
                _tell_whole(choice)
            self._newest = ui.switch("newest", value=not self.run_id, on_change=self._on_newest).props("dense")
            with ui.button("Download", icon="download").props("flat dense no-caps"), ui.menu() as self._downloads:
                pass
            self._link = ui.link("Open the run", "/runs").classes("text-sm")
        self._message = ui.label("").classes("empty-state").props('role=status aria-label="results"')
        with ui.row().classes("w-full items-center no-wrap gap-3") as self._shots:
            self._label = ui.label("").classes("text-sm font-medium whitespace-nowrap")
            self._label.props('role=status aria-label="shot shown"')
            self._slider = FreeSlider(min=0, max=1, value=0, on_change=self._choose_shot).props(
                'dense aria-label="shot"'
            )

    @property
    def looked(self) -> LookedAt | None:
        """What is looked at; None while there is nothing."""
        one = self.shown
        return LookedAt(self.run_id, one.id, self._shot) if one is not None and self._shot is not None else None

    @property
    def shown(self) -> ResultSet | None:
        """The result set that is chosen."""
        return next((one for one in self.sets if one.id == self._results_id), None)

    async def reload(self) -> None:
        """Offer what there is now; only where the newest is wanted something else is shown."""
        if self._newest.value:
            self._follow(await asyncio.to_thread(newest, self._context))
        runs = await asyncio.to_thread(runs_with_results, self._context)
        if not self.run_id and runs:
            self.run_id = runs[0].run_id
        await self._offer(runs)

    def _follow(self, one: LookedAt | None) -> None:
        if one is not None:
            self.run_id, self._results_id, self._shot = one.run_id, one.results_id, one.shot

    async def _offer(self, runs: list[RunSummary]) -> None:
        problem = "" if self.run_id else await asyncio.to_thread(_no_results, self._context)
        try:
            self.sets = await asyncio.to_thread(sets_of, self._context, self.run_id) if self.run_id else []
            if self.run_id and not self.sets:
                problem = nothing_text(await asyncio.to_thread(self._context.runs.summary, self.run_id))
        except NotFound as error:
            self.sets, problem = [], f"{error}: choose another one above, or open the page Runs."
        own = {self.run_id: self.run_id} if self.run_id else {}
        self._run.set_options(own | {run.run_id: _run_label(run) for run in runs}, value=self.run_id or None)
        self._message.set_text(problem)
        self._message.set_visibility(bool(problem))
        self._link.set_visibility(bool(self.run_id))
        self._link.props["href"] = f"/runs/{quote(self.run_id)}"
        await self._take_set()

    async def _take_set(self) -> None:
        if self.shown is None:
            first = first_of(self.sets)
            self._results_id = first.id if first else ""
        options = {one.id: label_of(one) for one in self.sets}
        self._set.set_options(options, value=self._results_id or None)
        shots = shots_of(self.shown) if self.shown else []
        if shots:
            place = min(
                range(len(shots)), key=lambda n: abs(shots[n] - (shots[-1] if self._shot is None else self._shot))
            )
            self._shot = shots[place]
            self._slider.props(f"max={max(1, len(shots) - 1)}")
            self._slider.value = place
            self._label.set_text(f"shot {self._shot} ({place + 1} of {len(shots)})")
        self._slider.set_visibility(len(shots) > 1)
        self._shots.set_visibility(bool(shots))
        self._show_address()
        await self._on_look()

    def _show_address(self) -> None:
        """While the newest is followed the address says so: whoever loads the page again goes on following."""
        looked = self.looked
        address = _FOLLOWING if self._newest.value else looked.address if looked else ""
        if address and address != self._address:
            self._address = address
            ui.navigate.history.replace(address)

    def offer_downloads(self, files: dict[str, str]) -> None:
        """Offer files, by label and address."""
        self._downloads.clear()
        with self._downloads, ui.column().classes("q-pa-sm gap-1"):
            for label, address in files.items():
                ui.link(label, address).props("download").classes("text-sm")
            if not files:
                ui.label("nothing").classes("text-sm")

    async def _choose_run(self) -> None:
        if self._run.value and self._run.value != self.run_id:
            self._pick()
            self.run_id, self._results_id, self._shot = self._run.value, "", None
            await self._offer(await asyncio.to_thread(runs_with_results, self._context))

    async def _choose_set(self) -> None:
        if self._set.value and self._set.value != self._results_id:
            self._pick()
            self._results_id = self._set.value
            await self._take_set()

    async def _choose_shot(self) -> None:
        if self.shown:
            shots = shots_of(self.shown)
            shot = shots[min(int(self._slider.value), len(shots) - 1)]
            if shot != self._shot:
                self._pick()
                self._shot = shot
                await self._take_set()

    async def _on_newest(self) -> None:
        self._show_address()
        if self._newest.value:
            await self.reload()

    def _pick(self) -> None:
        """Whatever a hand has chosen stays."""
        self._newest.value = False


def _tell_whole(choice: ui.select) -> None:
    """What is chosen, for who points at it: a long name has no room in its field."""
    with choice:
        told = ui.tooltip().bind_visibility_from(choice, "value", bool)
        told.bind_text_from(choice, "value", lambda value: dict(choice.options).get(value, ""))


def _no_results(context: Context) -> str:
    status = context.services.acquisition.status()
    if status.active and status.plan and status.plan.calibration and status.plan.recipes:
        return f"Run {status.run_id} is being recorded: what is made of its shots appears here."
    jobs = context.jobs.newest(states=_UNDER_WAY, limit=1, kinds=_MAKING)
    return f"Run {jobs[0].run_id} is being worked on: what is made of its shots appears here." if jobs else NO_RESULTS


def _run_label(run: RunSummary) -> str:
    return f"{run.run_id} · {run.kind or 'imported'}"
