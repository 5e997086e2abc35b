"""RunsPage: every run there is."""

from pathlib import Path

from nicegui import ui

from server.lab.services import Context
from server.web.ui.runs.run_list import RunList

STYLE_SHEET = Path(__file__).with_name("runs.css")


class RunsPage:
    """See ``DeskPage``."""

    def __init__(self, context: Context) -> None:
        ui.add_css(STYLE_SHEET)
        with ui.element("div").classes("columns one"):
            self._runs = RunList(context)

    async def refresh(self) -> None:
        """Everything here is a list."""

    async def reload(self) -> None:
        """Read the runs again."""
        await self._runs.reload()
