"""The desk: one for each browser tab. The bar and the rail stay, pages come and go between them by their addresses.

Mounted last, because it answers every path that nobody else does.
"""

from collections.abc import Callable
from functools import partial
from urllib.parse import unquote

from fastapi import FastAPI, Request
from nicegui import ui

from server.lab.services import Context
from server.rig.config import RigConfig
from server.web.abort_listener import AbortListener
from server.web.guard import SIGN_IN_PATH
from server.web.ui import theme
from server.web.ui.bar.header import Header
from server.web.ui.calibrate.calibrate_page import CalibratePage
from server.web.ui.desk_page import DeskPage
from server.web.ui.draft import DraftStore
from server.web.ui.drawer.drawer import Drawer
from server.web.ui.form_judge import FormJudge
from server.web.ui.live.live_page import LivePage
from server.web.ui.rail import STOPS, Rail
from server.web.ui.results.results_page import ResultsPage
from server.web.ui.rig.rig_page import RigPage
from server.web.ui.run.run_page import RunPage
from server.web.ui.runs.one_run_page import OneRunPage
from server.web.ui.runs.runs_page import RunsPage
from server.web.ui.theme import panel
from server.web.ui.visiting import is_signed_in, may_command

_REFRESH_S = 0.25
_LISTS_CHANGED = {"run_state", "job_changed", "calibration_chosen", "deed"}
"""A deed may have been to delete a run."""
_PATHS = ("/", "/rig", "/live", "/calibrate", "/run", "/results", "/runs")
_DEEP_PATHS = (
    "/results/{run_id}",
    "/results/{run_id}/{results_id}/{shot}",
    "/runs/{run_id}",
    "/runs/{run_id}/shots/{shot}",
)


def mount_page(app: FastAPI, config: RigConfig) -> None:
    """Serve the desk at the addresses of its pages; register every other route before."""
    drafts = _Drafts()

    def show(request: Request) -> None:
        abort: AbortListener = app.state.abort_listener
        abort.admit(request.headers["host"])
        Desk(app.state.context, *drafts.of(app.state.context), abort.port)

    for path in (*_PATHS, *_DEEP_PATHS):
        ui.page(path, title=f"tomoshadow: {config.name}")(show)
    ui.run_with(
        app, root=show, title=f"tomoshadow: {config.name}", dark=None, show_welcome_message=False, reconnect_timeout=10
    )


class _Pages(ui.sub_pages):
    """Pages by their addresses; at any other one there are bar, rail and ABORT all the same."""

    def _render_404(self) -> None:
        with panel("Nothing here"):
            ui.label(f"There is no page {ui.context.client.request.url.path}: choose one on the left.").classes(
                "empty-state"
            )


class _Drafts:
    """One draft for all tabs; made when the first of them is opened, because only then its folder is known."""

    def __init__(self) -> None:
        self._made: tuple[DraftStore, FormJudge] | None = None

    def of(self, context: Context) -> tuple[DraftStore, FormJudge]:
        """The draft of this rig, and what speaks against it."""
        if self._made is None:
            services, may_change = context.services, partial(may_command, context)
            path, has_stage = services.data_dir / "draft.json", services.rig.stage is not None
            draft = DraftStore(path, services.config, services.events, may_change, has_stage=has_stage)
            self._made = draft, FormJudge(context, draft)
        return self._made


class Desk:
    """What one browser tab shows; a page lives as long as the tab is at its address."""

    def __init__(self, context: Context, draft: DraftStore, judge: FormJudge, abort_port: int) -> None:
        self._context = context
        self._events = context.services.events
        self._page: DeskPage | None = None
        self._are_lists_old = True
        self._has_tokens, self._has_left = context.services.config.server.token is not None, False
        self._draft, self._judge = draft, judge
        theme.apply()
        self._header = Header(context, judge, abort_port)
        with ui.element("div").classes("desk"):
            self._rail = Rail(context)
            _Pages(self._routes()).classes("desk-page")
            self._drawer = Drawer(context, self._rail.drawer_button)
        ui.timer(_REFRESH_S, judge.refresh)
        ui.timer(_REFRESH_S, self._refresh)

    def _leave(self) -> None:
        """The session is over: sign in again, or begin another one; asked once, or the browser never gets there."""
        if not self._has_left:
            self._has_left = True
            ui.run_javascript(f"location.assign({SIGN_IN_PATH if self._has_tokens else '/'!r})")

    def _routes(self) -> dict[str, Callable[..., None]]:
        context, draft = self._context, self._draft
        pages: dict[str, Callable[[], DeskPage]] = {
            "/rig": lambda: RigPage(context, draft),
            "/live": lambda: LivePage(context, draft),
            "/calibrate": lambda: CalibratePage(context),
            "/run": lambda: RunPage(context, draft, self._judge),
            "/results": lambda: ResultsPage(context),
            "/runs": lambda: RunsPage(context),
        }
        shallow: dict[str, Callable[..., None]] = {
            path: partial(self._open, path, build) for path, build in pages.items()
        }
        shallow["/"] = shallow["/run"]  # where a day begins
        deep = {path: self._open_results if path.startswith("/results") else self._open_run for path in _DEEP_PATHS}
        return shallow | deep

    def _open_results(self, run_id: str, results_id: str = "", shot: str = "") -> None:
        named = unquote(run_id), unquote(results_id), shot
        self._open("/results", lambda: ResultsPage(self._context, *named))

    def _open_run(self, run_id: str, shot: str = "0") -> None:
        self._open("/runs", lambda: OneRunPage(self._context, unquote(run_id), shot))

    def _open(self, path: str, build: Callable[[], DeskPage]) -> None:
        self._page = build()
        self._rail.mark(path)
        self._header.page = next(stop.title for stop in STOPS if stop.path == path)
        self._are_lists_old = True

    async def _refresh(self) -> None:
        if not is_signed_in():
            self._leave()
            return
        events = self._drawer.new_events()
        for part in (self._header, self._rail):
            part.refresh()
        if page := self._page:
            await page.refresh()
        if self._are_lists_old or any(event.name in _LISTS_CHANGED for event in events):
            self._are_lists_old = False
            await self._drawer.reload()
            if page := self._page:
                await page.reload()
