"""RunForm: the next run. Limits are those of the plan and of the rig; a refusal is shown with its reason."""

import asyncio
from collections.abc import Callable
from functools import partial
from typing import Any

from nicegui import ui
from nicegui.events import GenericEventArguments

from daq.errors import DaqError
from daq.run.refusals import RefusalCode
from daq.run.state import RunOutcome
from daq.run_plan import RunKind
from server.lab.desk.reason import Reason
from server.lab.errors import ServerError
from server.lab.runs.run_summary import RunSummary
from server.lab.services import Context
from server.lab.starting.light_request import obey
from server.lab.starting.readiness import reasons_against
from server.lab.starting.run_start import start_run
from server.web.ui.bar.server_link import TICKET, light_request, shown_form
from server.web.ui.draft import (
    PLAN_FIELDS,
    PULSE_FIELDS,
    DraftStore,
    plan_of,
    problem_of,
    problem_of_current,
    problem_of_positions,
)
from server.web.ui.theme import panel

_REFERENCE_KINDS = (RunKind.DARK, RunKind.BACKGROUND)
_PASSING = (RefusalCode.BUSY, RefusalCode.STARTING)
_CALIBRATION = "Calibration (none: the current one)"
_NO_CALIBRATION = "Calibration (none: no volumes)"


class RunForm:
    """Built once per page.

    Parameters
    ----------
    context : Context
        The application.
    draft : DraftStore
        What the form shows first, and where every change goes.
    """

    def __init__(self, context: Context, draft: DraftStore) -> None:
        self._context = context
        self._draft = draft
        self._shown: list[str] = []
        self._fields: list[ui.input | ui.number] = []
        self._judged: tuple[Reason, ...] | None = None
        with panel("New run"):
            self._add_kind_and_name()
            with ui.grid(columns=2).classes("w-full gap-2"):
                self._shots = self._add_number("shots", "Shots", PLAN_FIELDS, whole=True)
                self._add_number("rate_hz", "Rate / Hz", PLAN_FIELDS)
                self._add_number("width_ns", "Pulse width / ns", PULSE_FIELDS, whole=True)
                self._add_number("separation_ns", "Separation / ns", PULSE_FIELDS, whole=True)
                for view in context.services.config.views:
                    self._add_current(view)
            self._add_choices()
            self._refusal = ui.label("").classes("refusal").props("role=alert")
            self._start = ui.button("Start run", icon="play_arrow").classes("w-full")
            self._start.on("click", self._on_start, js_handler=TICKET)
        self._check()

    def refresh(self) -> None:
        """Follow the state of acquisition."""
        self._start.set_enabled(not self._context.services.acquisition.status().active)

    async def reload_choices(self) -> None:
        """Show the reference runs and calibrations that exist now."""
        runs, calibrations = await asyncio.gather(
            asyncio.to_thread(self._context.runs.newest), asyncio.to_thread(self._context.calibrations.list)
        )
        references = [run for run in runs if run.kind in _REFERENCE_KINDS and run.outcome == RunOutcome.COMPLETED]
        self._show_references(references)
        known = {item.id: item.id + (" (current)" if item.current else "") for item in calibrations}
        calibration = self._draft.values["calibration"]
        is_any_current = any(item.current for item in calibrations)
        self._calibration.set_label(_CALIBRATION if is_any_current else _NO_CALIBRATION)
        self._calibration.set_options(known, value=calibration if calibration in known else None)

    def _show_references(self, references: list[RunSummary]) -> None:
        """Offer the reference runs. What the operator chose stays chosen; until then the newest of each kind are."""
        values, labels = self._draft.values, {run.run_id: _reference_label(run) for run in references}
        newest = sorted({run.kind: run.run_id for run in reversed(references)}.values())
        self._shown = values["references"] if values["are_references_chosen"] else newest
        gone = {run_id: f"{run_id}: is gone" for run_id in self._shown if run_id not in labels}
        self._references.set_options(labels | gone, value=self._shown)

    def _keep_references(self, event: Any) -> None:
        """Whatever is not what we show is a choice; a browser may also repeat what it was told."""
        self._draft.values["references"] = event.value
        if self._draft.values["are_references_chosen"] or sorted(event.value) != sorted(self._shown):
            self._draft.set("are_references_chosen", True)
            self._draft.set("references", event.value)
        self._check()

    def _add_kind_and_name(self) -> None:
        kinds = {kind.value: kind.value.capitalize() for kind in RunKind}
        ui.toggle(kinds, value=self._draft.values["kind"], on_change=self._changed("kind")).props(
            'dense unelevated spread no-caps size=sm aria-label="Kind of run"'
        ).classes("w-full")
        name = ui.input(
            "Name",
            value=self._draft.values["name"],
            on_change=self._changed("name"),
            validation=lambda text: problem_of(PLAN_FIELDS, "name", text) and "letters, digits, space . _ -",
        )
        self._fields.append(name.props("dense outlined hide-bottom-space data-draft=name").classes("w-full"))

    def _add_number(self, name: str, label: str, fields: dict[str, Any], *, whole: bool = False) -> ui.number:
        number = ui.number(
            label,
            value=self._draft.values[name],
            on_change=self._changed(name),
            validation=lambda value: problem_of(fields, name, value),
            precision=0 if whole else None,
        )
        self._fields.append(number.props(f"dense outlined hide-bottom-space data-draft={name}"))
        return number

    def _add_current(self, view: str) -> None:
        limit_a = self._context.services.config.views[view].max_current_a

        def keep(event: Any) -> None:
            self._changed("current_a")(_Changed({**self._draft.values["current_a"], view: event.value}))

        number = ui.number(
            f"LED {view} / A",
            value=self._draft.values["current_a"].get(view),
            on_change=keep,
            validation=lambda value: problem_of_current(value, limit_a),
        )
        self._fields.append(number.props(f'dense outlined hide-bottom-space data-draft="current_a:{view}"'))

    def _add_choices(self) -> None:
        positions = ui.input(
            "Target positions / mm",
            value=self._draft.values["stage_z_mm"],
            on_change=self._changed("stage_z_mm"),
            validation=problem_of_positions,
        )
        self._fields.append(positions.props("dense outlined hide-bottom-space data-draft=stage_z_mm").classes("w-full"))
        self._positions = positions
        self._references = (
            ui.select({}, label="Dark and background runs", multiple=True, value=[], on_change=self._keep_references)
            .props("dense outlined use-chips options-dense")
            .classes("w-full")
        )
        self._calibration = (
            ui.select({}, label=_CALIBRATION, clearable=True, on_change=self._changed("calibration"))
            .props("dense outlined options-dense")
            .classes("w-full")
        )

    def _changed(self, name: str) -> Callable[[Any], None]:
        def keep(event: Any) -> None:
            self._draft.set(name, event.value)
            self._check()

        return keep

    def _check(self) -> None:
        """Say at once why the rig would refuse this plan."""
        if not hasattr(self, "_start"):
            return  # while the form is being built
        kind = RunKind(self._draft.values["kind"])
        has_stage = self._context.services.rig.stage is not None
        self._shots.set_label("Shots per position" if kind is RunKind.CALIBRATION and has_stage else "Shots")
        self._positions.set_visibility(kind is RunKind.CALIBRATION and has_stage)
        self._references.set_visibility(kind is RunKind.SAMPLE)
        self._calibration.set_visibility(kind is RunKind.SAMPLE)
        self._judged = None

    async def judge(self) -> None:
        """Say why the rig would refuse this plan, again whenever the form or the rig has changed."""
        reasons = self._context.desk.state.reasons
        if self._judged == reasons:
            return
        self._judged = reasons
        against = await asyncio.to_thread(self._reasons_against)
        self._refusal.set_text("\n".join(f"{one.text} ({one.remedy})" for one in against if one.code not in _PASSING))

    def _reasons_against(self) -> tuple[Reason, ...]:
        try:
            plan = plan_of(self._draft.values)
        except ValueError:
            return ()  # the field itself says what is wrong with it
        return reasons_against(self._context, plan)

    async def _on_start(self, click: GenericEventArguments) -> None:
        if not all([field.validate() for field in self._fields if field.visible]):
            return
        self._draft.adopt(shown_form(click.args))
        try:
            plan = plan_of(self._draft.values)
            start = partial(start_run, self._context, plan)
            await asyncio.to_thread(obey, self._context, light_request(click.args), plan.model_dump_json(), start)
        except (DaqError, ServerError, ValueError) as error:
            self._refusal.set_text(str(error))
        else:
            self._refusal.set_text("")


class _Changed:
    """A new value, in the shape of an event."""

    def __init__(self, value: Any) -> None:
        self.value = value


def _reference_label(run: RunSummary) -> str:
    return f"{run.kind}: {run.name}, {run.shots_valid} shots, {run.run_id}"
