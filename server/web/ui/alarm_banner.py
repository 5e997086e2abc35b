"""AlarmBanner: tells whoever looks at the page that the views have moved since they were calibrated."""

from nicegui import ui

from processing.calibration.verdict import Verdict
from server.lab.services import Context
from server.lab.watch import CalibrationStanding


class AlarmBanner:
    """Built once per page, refreshed by its timer; there only while there is an alarm."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._shown: CalibrationStanding | None = None
        self._banner = ui.row().classes("alarm-banner items-center no-wrap").props("role=alert")
        with self._banner:
            ui.icon("warning", size="22px")
            self._title = ui.label("").classes("font-medium")
            self._text = ui.label("").classes("text-sm")
        self._banner.set_visibility(False)

    def refresh(self) -> None:
        """Show what has changed."""
        standing = self._context.standing
        if standing == self._shown:
            return
        self._shown = standing
        self._banner.set_visibility(standing is not None and standing.is_alarm)
        if standing is not None and standing.is_alarm:
            self._show(standing)

    def _show(self, standing: CalibrationStanding) -> None:
        stops = standing.verdict is Verdict.REFUSE
        self._banner.classes(add="stop" if stops else "warn", remove="warn" if stops else "stop")
        worst = standing.worst_view or "a view"
        by = f"{standing.views[worst]:.2f} px" if worst in standing.views else "has moved far"
        self._title.set_text(f"{'RECONSTRUCTION STOPPED' if stops else 'CALIBRATION ALARM'}: {worst} {by}")
        self._text.set_text(f"{standing.message} Shots checked: {standing.shots_checked}.")
