"""RunsPage: every run there is, and what can be made of it."""

from nicegui import ui

from server.lab.services import Context
from server.web.ui.runs.run_table import RunTable


class RunsPage:
    """See ``DeskPage``."""

    def __init__(self, context: Context) -> None:
        with ui.element("div").classes("columns one"):
            self._runs = RunTable(context)

    async def refresh(self) -> None:
        """Everything here is a list."""

    async def reload(self) -> None:
        """Read the runs again."""
        await self._runs.reload()
