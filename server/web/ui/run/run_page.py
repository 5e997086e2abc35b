"""RunPage: the next run, the one that is going on, and what its cameras see."""

from nicegui import ui

from server.lab.services import Context
from server.web.ui.draft import DraftStore
from server.web.ui.form_judge import FormJudge
from server.web.ui.live.live_tiles import LiveTiles
from server.web.ui.run.preflight_panel import PreflightPanel
from server.web.ui.run.run_form import RunForm
from server.web.ui.run.run_panel import RunPanel
from server.web.ui.theme import panel
from server.web.ui.visiting import visitor


class RunPage:
    """See ``DeskPage``."""

    def __init__(self, context: Context, draft: DraftStore, judge: FormJudge) -> None:
        self._judge = judge
        with ui.element("div").classes("columns"):
            with ui.element("div").classes("column").props("tabindex=0"):
                self._run, self._checks = RunPanel(context), PreflightPanel()
                with panel("Cameras"):
                    LiveTiles(context.services.rig.cameras, "no picture yet")
            with ui.element("div").classes("column controls"):
                self._form = RunForm(context, draft, judge)

    async def refresh(self) -> None:
        """Follow the state of acquisition, and say what speaks against a start."""
        self._run.refresh()
        self._form.refresh()
        self._checks.show(self._judge.checks(visitor()))

    async def reload(self) -> None:
        """Read references and calibrations again."""
        await self._form.reload_choices()
