"""LivePanel: the pictures of all cameras, and the buttons of the live view. Its light is that of the run form."""

import asyncio
from collections.abc import Callable
from functools import partial

from nicegui import ui
from nicegui.events import GenericEventArguments

from daq.errors import DaqError
from daq.run.state import RunState
from daq.run_plan import LivePlan
from server.lab.desk.reason import refusal_text
from server.lab.errors import ServerError
from server.lab.services import Context
from server.lab.starting.command import tell_deed
from server.lab.starting.light_request import obey
from server.lab.starting.run_start import SingleShot, shoot
from server.web.ui.asking import try_to
from server.web.ui.bar.server_link import TICKET, light_request, shown_form
from server.web.ui.draft import DraftStore, problem_of, pulse_of
from server.web.ui.live.live_tiles import LiveTiles
from server.web.ui.refusal import Refusal
from server.web.ui.theme import panel
from server.web.ui.visiting import for_operators, visitor, why_not

_FIELDS = LivePlan.model_fields
_HINT = "No picture yet. Live shows the cameras and records nothing; Shoot one takes a single shot."


class LivePanel:
    """Built once per page, refreshed by its timer.

    Parameters
    ----------
    context : Context
        The application.
    draft : DraftStore
        Knows pulses and currents.
    """

    def __init__(self, context: Context, draft: DraftStore) -> None:
        self._context = context
        self._acquisition = context.services.acquisition
        self._draft = draft
        with panel("Live"):
            self._add_controls()
            self._refusal = Refusal(self._basis, "live refusal")
            LiveTiles(context.services.rig.cameras, _HINT, full=True)
        self.refresh()

    def _add_controls(self) -> None:
        with ui.row().classes("w-full gap-2 items-center"):
            self._start = ui.button("Live", icon="videocam").props("outline dense no-caps")
            self._start.on("click", self._on_start, js_handler=TICKET)
            self._end = ui.button("End live", icon="videocam_off", on_click=self._on_end)
            self._end.props("outline dense no-caps")
            self._rate = ui.number(
                "Live / Hz",
                value=_FIELDS["rate_hz"].default,
                validation=lambda value: problem_of(_FIELDS, "rate_hz", value),
            )
            self._rate.props("dense outlined hide-bottom-space").classes("w-24")
            self._lit = ui.switch("Pulsed light", value=True)
            self._lit.tooltip("Pulses and currents of the form of a new run; off: no light but that of the room")
            self._shoot = ui.button("Shoot one", icon="photo_camera")
            self._shoot.on("click", self._on_shoot, js_handler=TICKET)
            self._shoot.props("outline dense no-caps")
            self._shoot.tooltip("One shot with the light of the form of a new run; the next one takes its place")
            self._keep = ui.button("Keep shot", icon="save", on_click=self._on_keep).props("outline dense no-caps")

    def refresh(self) -> None:
        """Follow the state of acquisition."""
        status = self._acquisition.status()
        is_live = status.state is RunState.LIVE
        may_shoot, why = status.resting or is_live, why_not(self._context)
        for_operators(self._start, may_shoot, why)
        self._start.set_text("Apply" if is_live else "Live")
        for_operators(self._end, is_live)
        for_operators(self._shoot, may_shoot, why)
        for_operators(self._keep).set_visibility(bool(self._context.unkept_runs.ids) and status.resting)
        self._refusal.follow()

    def _basis(self) -> object:
        """What a refusal is about."""
        return self._context.desk.state.reasons, self._draft.version, self._rate.value, self._lit.value

    async def _on_end(self) -> None:
        async def end() -> None:
            await asyncio.to_thread(self._acquisition.end_live)
            tell_deed(self._context, visitor(), "ended the live view")

        await try_to(end)

    async def _on_start(self, click: GenericEventArguments) -> None:
        self._draft.adopt(shown_form(click.args))
        await self._obey_start(click)

    async def _obey_start(self, click: GenericEventArguments) -> None:
        if self._rate.validate():
            await self._try(partial(obey, self._context, light_request(click.args), "live", self._show))

    async def apply(self, click: GenericEventArguments) -> None:
        """Show pulses and currents that have changed, if the rig is shown live by them; gets the click that did it."""
        if self._lit.value and self._acquisition.status().state is RunState.LIVE:
            await self._obey_start(click)

    def _show(self) -> None:
        pulse = pulse_of(self._draft.values) if self._lit.value else None
        self._acquisition.start_live(LivePlan(rate_hz=self._rate.value, pulse=pulse))

    async def _on_shoot(self, click: GenericEventArguments) -> None:
        self._draft.adopt(shown_form(click.args))
        await self._try(partial(obey, self._context, light_request(click.args), "shot", self._take))

    def _take(self) -> None:
        values = self._draft.values
        references, calibration = tuple(values["references"]), values["calibration"]
        shoot(self._context, SingleShot(pulse=pulse_of(values), references=references, calibration=calibration))

    async def _on_keep(self) -> None:
        unkept = self._context.unkept_runs
        await try_to(lambda: asyncio.to_thread(unkept.keep, unkept.ids[-1]))

    async def _try(self, action: Callable[[], object]) -> None:
        """Do what takes its time outside of the event loop, and say why it was refused."""
        try:
            await asyncio.to_thread(action)
        except (DaqError, ServerError, ValueError) as error:
            self._refusal.show(refusal_text(error))
        else:
            self._refusal.clear()
