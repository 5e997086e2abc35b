"""RunForm: the next run. Limits are those of the plan and of the rig; a refusal is shown with its reason."""

import asyncio
import time
from functools import partial

from nicegui import ui
from nicegui.events import GenericEventArguments

from daq.errors import DaqError
from daq.run_plan import RunKind, RunPlan
from server.lab.desk.once import described
from server.lab.desk.reason import Reason
from server.lab.desk.visitor import Visitor
from server.lab.errors import ServerError
from server.lab.services import Context
from server.lab.starting.light_request import obey
from server.lab.starting.preflight_list import PASSING, Check, preflight
from server.lab.starting.readiness import reasons_against
from server.lab.starting.run_start import start_run
from server.web.ui.bar.server_link import TICKET, light_request, shown_form
from server.web.ui.draft import DraftStore, plan_of
from server.web.ui.run.chosen_runs import ChosenRuns
from server.web.ui.run.chosen_work import ChosenWork
from server.web.ui.run.form_fields import FormFields
from server.web.ui.run.preflight_panel import PreflightPanel
from server.web.ui.run.template_bar import TemplateBar
from server.web.ui.run.templates import TemplateStore
from server.web.ui.theme import panel
from server.web.ui.visiting import may_command, told, visitor

_LOOK_AGAIN_S = 5.0
"""Disk and references change without a word."""


class RunForm:
    """Built once per page.

    Parameters
    ----------
    context : Context
        The application.
    draft : DraftStore
        What the form shows first, and where every change goes.
    checks : PreflightPanel
        Shows what speaks against the form, and what does not.
    """

    def __init__(self, context: Context, draft: DraftStore, checks: PreflightPanel) -> None:
        self._context, self._draft, self._checks = context, draft, checks
        self._shown = draft.version
        self._judged: object = None
        self._judged_s = 0.0
        templates = TemplateStore(context.services.data_dir / "templates", context.services.events)
        with panel("New run"):
            self._templates = TemplateBar(templates, draft, self._show)
            self._fields = FormFields(context, draft, self._changed)
            self._chosen = ChosenRuns(context, draft, self._changed)
            self._work = ChosenWork(draft, self._changed)
            with ui.expansion("Notes", icon="edit_note", value=True).classes("w-full notes"):
                self._fields.add_notes()
            self._refusal = ui.label("").classes("refusal").props("role=alert")
            self._start = ui.button("Start run", icon="play_arrow").classes("w-full")
            self._start.on("click", self._on_start, js_handler=TICKET)
        self._show_kind()

    def refresh(self) -> None:
        """Follow the state of acquisition, who holds control, and other tabs."""
        may_change = may_command(self._context)
        self._start.set_enabled(may_change and not self._context.services.acquisition.status().active)
        self._templates.allow(may_change)
        self._fields.allow(may_change)
        self._chosen.allow(may_change)
        self._work.allow(may_change)
        if self._draft.version != self._shown:
            self._show()

    async def reload_choices(self) -> None:
        """Show the reference runs and calibrations that exist now."""
        await self._chosen.reload()

    async def judge(self) -> None:
        """Look at everything again whenever form, rig or control has changed, and every few seconds."""
        who, holder = visitor(), self._context.control.holder
        basis = (self._context.desk.state.reasons, self._draft.version, holder and holder.who, who)
        if basis == self._judged and time.monotonic() < self._judged_s + _LOOK_AGAIN_S:
            return
        self._judged, self._judged_s = basis, time.monotonic()
        plan = self._plan()
        if plan is None:
            self._checks.show(None)
            self._refusal.set_text("")
            return
        reasons, checks = await asyncio.to_thread(self._look, plan, who)
        self._checks.show(checks)
        self._refusal.set_text("\n".join(f"{one.text} ({one.remedy})" for one in reasons if one.code not in PASSING))

    def _look(self, plan: RunPlan, who: Visitor) -> tuple[tuple[Reason, ...], tuple[Check, ...]]:
        reasons = reasons_against(self._context, plan)
        return reasons, preflight(self._context, plan, who, reasons)

    def _plan(self) -> RunPlan | None:
        try:
            return plan_of(self._draft.values)
        except (ValueError, TypeError):
            return None  # the field itself says what is wrong with it

    def _changed(self) -> None:
        self._shown = self._draft.version
        self._show_kind()

    def _show(self) -> None:
        self._shown = self._draft.version
        self._fields.show()
        self._chosen.show()
        self._work.show()
        self._show_kind()

    def _show_kind(self) -> None:
        kind = RunKind(self._draft.values["kind"])
        for part in (self._fields, self._chosen, self._work):
            part.show_kind(kind)

    async def _on_start(self, click: GenericEventArguments) -> None:
        request, shown = light_request(click.args), shown_form(click.args)
        try:
            self._context.control.check(request.who)
            self._draft.adopt(shown)
            if not self._fields.are_good():
                return
            plan = plan_of(self._draft.values)
            start = partial(start_run, self._context, plan)
            await asyncio.to_thread(obey, self._context, request, described("run", plan), start)
        except (DaqError, ServerError, ValueError) as error:
            self._refusal.set_text(told(error))
        else:
            self._refusal.set_text("")
