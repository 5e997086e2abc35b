"""RunForm: the next run. Limits are those of the plan and of the rig; a refusal is shown with its reason."""

import asyncio
from functools import partial

from nicegui import ui
from nicegui.events import GenericEventArguments

from daq.errors import DaqError
from daq.run_plan import RunKind
from server.lab.desk.once import described
from server.lab.errors import ServerError
from server.lab.services import Context
from server.lab.starting.light_request import obey
from server.lab.starting.preflight_list import PASSING
from server.lab.starting.run_start import start_run
from server.web.ui.bar.server_link import TICKET, light_request, shown_form
from server.web.ui.draft import DraftStore
from server.web.ui.form_judge import FormJudge
from server.web.ui.refusal import Refusal
from server.web.ui.run.chosen_runs import ChosenRuns
from server.web.ui.run.chosen_work import ChosenWork
from server.web.ui.run.form_fields import FormFields
from server.web.ui.run.template_bar import TemplateBar
from server.web.ui.run.templates import TemplateStore
from server.web.ui.theme import panel
from server.web.ui.visiting import for_operators, told, why_not

_TOLD_ELSEWHERE = {*PASSING, "form"}
"""They end by themselves, or the field itself says what is wrong with it."""


class RunForm:
    """Built once per page.

    Parameters
    ----------
    context : Context
        The application.
    draft : DraftStore
        What the form shows first, and where every change goes.
    judge : FormJudge
        Knows what speaks against the form.
    """

    def __init__(self, context: Context, draft: DraftStore, judge: FormJudge) -> None:
        self._context, self._draft, self._judge = context, draft, judge
        self._shown = draft.version
        templates = TemplateStore(context.services.data_dir / "templates", context.services.events)
        with panel("New run"):
            self._templates = TemplateBar(templates, draft, self._show)
            self._fields = FormFields(context, draft, self._changed)
            self._chosen = ChosenRuns(context, draft, self._changed)
            self._work = ChosenWork(draft, self._changed)
            with ui.expansion("Notes", icon="edit_note", value=True).classes("w-full notes"):
                self._fields.add_notes()
            self._refusal = Refusal(lambda: judge.verdict, "why no run starts")
            self._start = ui.button("Start run", icon="play_arrow").classes("w-full")
            self._start.on("click", self._on_start, js_handler=TICKET)
        self._show_kind()

    def refresh(self) -> None:
        """Follow the state of acquisition, who holds control, what speaks against a start, and other tabs."""
        self._refusal.follow(self._against())
        why = why_not(self._context)
        for_operators(self._start, not self._context.services.acquisition.status().active, why)
        for part in (self._templates, self._fields, self._chosen, self._work):
            part.allow(why)
        if self._draft.version != self._shown:
            self._show()

    async def reload_choices(self) -> None:
        """Show the reference runs and calibrations that exist now."""
        await self._chosen.reload()

    def _against(self) -> str:
        """What speaks against a start now."""
        reasons = self._judge.verdict.reasons if self._judge.verdict else ()
        return "\n".join(f"{one.text} ({one.remedy})" for one in reasons if one.code not in _TOLD_ELSEWHERE)

    def _changed(self) -> None:
        """Here: what is shown already is not shown again, unless another tab has changed something meanwhile."""
        if self._draft.version == self._shown + 1:
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
            plan = self._draft.plan
            start = partial(start_run, self._context, plan)
            await asyncio.to_thread(obey, self._context, request, described("run", plan), start)
        except (DaqError, ServerError, ValueError) as error:
            self._refusal.show(told(error))
        else:
            self._refusal.clear()
