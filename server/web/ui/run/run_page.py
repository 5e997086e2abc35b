"""RunPage: the next run, the one that is going on, and what its cameras see."""

from nicegui import ui

from server.lab.services import Context
from server.web.ui.draft import DraftStore
from server.web.ui.live.live_tiles import LiveTiles
from server.web.ui.run.preflight_panel import PreflightPanel
from server.web.ui.run.run_form import RunForm
from server.web.ui.run.run_panel import RunPanel
from server.web.ui.theme import panel


class RunPage:
    """See ``DeskPage``."""

    def __init__(self, context: Context, draft: DraftStore) -> None:
        with ui.element("div").classes("columns"):
            with ui.element("div").classes("column").props("tabindex=0"):
                self._run, checks = RunPanel(context), PreflightPanel()
                with panel("Cameras"):
                    LiveTiles(context.services.rig.cameras, "no picture yet")
            with ui.element("div").classes("column controls"):
                self._form = RunForm(context, draft, checks)

    async def refresh(self) -> None:
        """Follow the state of acquisition, and say what speaks against a start."""
        self._run.refresh()
        self._form.refresh()
        await self._form.judge()

    async def reload(self) -> None:
        """Read references and calibrations again."""
        await self._form.reload_choices()
