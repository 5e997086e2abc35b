"""PreflightPanel: everything that is looked at before a run, always evaluated, one line each."""

from collections.abc import Sequence

from nicegui import ui

from server.lab.starting.preflight_list import Check, CheckResult
from server.web.ui.theme import panel

_ICONS = {
    CheckResult.GOOD: "check_circle",
    CheckResult.WARN: "info",
    CheckResult.WAIT: "hourglass_top",
    CheckResult.REFUSED: "cancel",
}


class PreflightPanel:
    """Built once per page."""

    def __init__(self) -> None:
        self._shown: tuple[Check, ...] = ()
        with panel("Pre-flight"):
            self._list = ui.element("ul").classes("checks")

    def show(self, checks: Sequence[Check]) -> None:
        """Show what was found."""
        if tuple(checks) == self._shown:
            return
        self._shown = tuple(checks)
        self._list.clear()
        with self._list:
            for check in checks:
                _show(check)


def _show(check: Check) -> None:
    row = ui.element("li").classes(f"check {check.finding}")
    row.props["aria-label"] = check.name
    with row:
        ui.icon(_ICONS[check.finding], size="17px").props(f'aria-label="{check.finding}"')
        ui.label(check.name).classes("check-name")
        with ui.element("div").classes("check-text"):
            ui.label(check.text)
            if check.remedy:
                ui.label(check.remedy).classes("check-remedy")
