"""ChosenRuns: references and calibration of the next run. What is shown stays; a newer one is only told."""

import asyncio
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

from nicegui import ui

from daq.counted import counted
from daq.run.references import REFERENCE_KINDS
from daq.run_plan import RunKind
from server.lab.errors import NotFound
from server.lab.runs.run_store import RunStore
from server.lab.runs.run_summary import RunSummary
from server.lab.services import Context
from server.web.ui.draft import DraftStore
from server.web.ui.visiting import for_operators

_OFFERED = 30
"""Of each kind, the newest; what is chosen stands beside them, however old it is."""
_CALIBRATION = "Calibration; none: current"
_NO_CALIBRATION = "Calibration; none: no volumes"


class ChosenRuns:
    """Built once per page.

    Parameters
    ----------
    context : Context
        Knows runs and calibrations.
    draft : DraftStore
        What is chosen.
    changed : Callable[[], None]
        Called after each choice.
    """

    def __init__(self, context: Context, draft: DraftStore, changed: Callable[[], None]) -> None:
        self._context, self._draft, self._changed = context, draft, changed
        self._known: list[RunSummary] = []
        self._calibrations: dict[str, str] = {}
        with ui.column().classes("w-full gap-2") as self._box:
            self._references = ui.select(
                {}, label="Dark and background runs", multiple=True, value=[], on_change=self._keep_references
            )
            self._references.props("dense outlined use-chips options-dense").classes("w-full")
            self._newest = ui.button("Use the newest", on_click=self._use_newest).props("flat dense no-caps")
            self._newest.set_visibility(False)
            self._calibration = ui.select({}, label=_CALIBRATION, clearable=True, on_change=self._keep_calibration)
            self._calibration.props("dense outlined options-dense").classes("w-full")

    def show_kind(self, kind: RunKind) -> None:
        """Only a sample run has any."""
        self._box.set_visibility(kind is RunKind.SAMPLE)

    def allow(self, why: str) -> None:
        """Nobody chooses while somebody else holds control; why, where that is so."""
        for field in (self._references, self._calibration, self._newest):
            for_operators(field, why=why)

    async def reload(self) -> None:
        """Offer the runs and calibrations that exist now."""
        runs, calibrations = await asyncio.gather(
            asyncio.to_thread(known_references, self._context.runs, tuple(self._draft.values["references"])),
            asyncio.to_thread(self._context.calibrations.list),
        )
        self._known = runs
        self._pin_what_is_missing()
        self._calibrations = {item.id: item.id + (" (current)" if item.current else "") for item in calibrations}
        self._calibration.set_label(_CALIBRATION if any(item.current for item in calibrations) else _NO_CALIBRATION)
        self.show()

    def show(self) -> None:
        """Show what is chosen, here or in another tab."""
        chosen = self._draft.values["references"]
        _offer(self._references, {run.run_id: _label(run) for run in self._known}, chosen, list(chosen))
        self._newest.set_visibility(bool(chosen) and set(_newest_of(self._known).values()) != set(chosen))
        calibration = self._draft.values["calibration"]
        _offer(self._calibration, self._calibrations, [calibration] if calibration else [], calibration)

    def _pin_what_is_missing(self) -> None:
        """Propose the newest of each kind of which none is chosen, until the operator has chosen himself."""
        values = self._draft.values
        if values["are_references_chosen"]:
            return
        kinds = {run.run_id: run.kind for run in self._known}
        kept = [run_id for run_id in values["references"] if run_id in kinds]
        has = {kinds[run_id] for run_id in kept}
        pinned = kept + [run_id for kind, run_id in _newest_of(self._known).items() if kind not in has]
        if sorted(pinned) != sorted(values["references"]):
            self._draft.set("references", pinned)
            self._changed()

    def _use_newest(self) -> None:
        self._draft.set("references", list(_newest_of(self._known).values()))
        self.show()
        self._changed()

    def _keep_references(self, event: Any) -> None:
        """Whatever is not what we show is a choice; a browser may also repeat what it was told."""
        if sorted(event.value) != sorted(self._draft.values["references"]):
            self._draft.set("are_references_chosen", True)
            self._draft.set("references", list(event.value))
            self.show()
            self._changed()

    def _keep_calibration(self, event: Any) -> None:
        if event.value != self._draft.values["calibration"]:
            self._draft.set("calibration", event.value)
            self._changed()


def _offer(field: ui.select, known: dict[str, str], chosen: Iterable[str], value: Any) -> None:
    """Offer what is known; what was chosen, and is gone since, gives way to nothing else unasked."""
    offered = known | {one: f"{one}: is gone" for one in chosen if one not in known}
    if field.options != offered or field.value != value:
        field.set_options(offered, value=value)


def known_references(runs: RunStore, chosen: Iterable[str]) -> list[RunSummary]:
    """The newest runs that can be references, newest first of each kind, and those that are chosen already."""
    known = {run.run_id: run for kind in REFERENCE_KINDS for run in runs.references(kind, _OFFERED)}
    for run_id in chosen:
        with suppress(NotFound):
            known.setdefault(run_id, runs.summary(run_id))
    return list(known.values())


def _newest_of(runs: list[RunSummary]) -> dict[RunKind, str]:
    """The newest run of each kind, of runs that are listed newest first."""
    return {run.kind: run.run_id for run in reversed(runs) if run.kind in REFERENCE_KINDS}


def _label(run: RunSummary) -> str:
    told = run.outcome if run.shots_valid is None else counted(run.shots_valid, "shot")
    return f"{run.kind}: {run.name}, {told}, {run.run_id}"
