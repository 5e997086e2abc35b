"""The page: one screen for one operator. Mounted last, because it answers every path that nobody else does."""

from fastapi import FastAPI, Request
from nicegui import ui

from server.lab.services import Context
from server.rig.config import RigConfig
from server.web.abort_listener import AbortListener
from server.web.ui import theme
from server.web.ui.draft import DraftStore
from server.web.ui.droplet_panel import DropletPanel
from server.web.ui.event_log import EventLog
from server.web.ui.header import Header
from server.web.ui.live_panel import LivePanel
from server.web.ui.run_form import RunForm
from server.web.ui.run_panel import RunPanel
from server.web.ui.tables import JobPanel, RunTable
from server.web.ui.volume_panel import VolumePanel

_REFRESH_S = 0.25
_EVENTS_SHOWN = 100
_LISTS_CHANGED = {"run_state", "job_changed", "calibration_chosen"}


def mount_page(app: FastAPI, config: RigConfig) -> None:
    """Serve the page at ``/``; register every other route before."""

    @ui.page("/", title=f"tomoshadow: {config.name}")
    def show(request: Request) -> None:
        abort: AbortListener = app.state.abort_listener
        abort.admit(request.headers["host"])
        Page(app.state.context, abort.port)

    ui.run_with(app, dark=None, show_welcome_message=False, reconnect_timeout=10)


class Page:
    """The page of one browser tab."""

    def __init__(self, context: Context, abort_port: int) -> None:
        self._events = context.services.events
        self._seen = max(0, self._events.newest - _EVENTS_SHOWN)
        self._are_lists_old = True
        dark = theme.apply()
        draft = DraftStore(context.services.data_dir / "draft.json", context.services.config, self._events)
        self._header = Header(context, dark, abort_port)
        with ui.element("div").classes("screen"):
            with ui.element("div").classes("column"):
                self._live = LivePanel(context, draft)
                self._runs, self._jobs = RunTable(context), JobPanel(context)
            with ui.element("div").classes("column wide"):
                self._volume = VolumePanel(context)
                self._droplets = DropletPanel(context)
            with ui.element("div").classes("column controls"):
                self._run, self._form, self._log = RunPanel(context), RunForm(context, draft), EventLog()
        ui.timer(_REFRESH_S, self._refresh)

    async def _refresh(self) -> None:
        events = self._events.since(self._seen)
        self._log.add(events)
        for part in (self._header, self._live, self._run, self._form):
            part.refresh()
        await self._form.judge()
        if events:
            self._seen = events[-1].id
        if self._are_lists_old or any(event.name in _LISTS_CHANGED for event in events):
            self._are_lists_old = False
            await self._runs.reload()
            await self._jobs.reload()
            await self._volume.reload()
            await self._droplets.reload()
            await self._form.reload_choices()
