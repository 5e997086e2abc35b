"""CalibratePage: from a calibration run to the calibration that new runs are reconstructed with."""

from nicegui import ui

from server.lab.services import Context
from server.web.ui.calibrate.calibration_list import CalibrationList
from server.web.ui.calibrate.calibration_view import CalibrationView
from server.web.ui.calibrate.target_runs import TargetRuns


class CalibratePage:
    """See ``DeskPage``."""

    def __init__(self, context: Context) -> None:
        with ui.element("div").classes("columns two"):
            with ui.element("div").classes("column"):
                self._runs = TargetRuns(context)
                self._list = CalibrationList(context, self._show)
            with ui.element("div").classes("column"):
                self._view = CalibrationView(context)

    async def refresh(self) -> None:
        """Everything here is a list."""

    async def reload(self) -> None:
        """Read runs and calibrations again, and the one that is shown, or the current one."""
        await self._runs.reload()
        await self._list.reload()
        await self._view.reload(self._list.proposed)

    async def _show(self, calibration_id: str) -> None:
        await self._view.show(calibration_id)
