"""CalibratePage: from a calibration run to the calibration that new runs are reconstructed with."""

from nicegui import ui

from daq.run_plan import RunKind
from server.lab.services import Context
from server.web.ui.runs.run_table import RunTable


class CalibratePage:
    """See ``DeskPage``."""

    def __init__(self, context: Context) -> None:
        with ui.element("div").classes("columns one"):
            self._runs = RunTable(context, kinds=(RunKind.CALIBRATION,))

    async def refresh(self) -> None:
        """Everything here is a list."""

    async def reload(self) -> None:
        """Read the calibration runs again."""
        await self._runs.reload()
