"""Header: what is always in sight. Which rig, its lamps, state and calibration, who holds control, ABORT, alarms."""

import time

from nicegui import ui

from server.lab.services import Context
from server.web.ui.bar.abort_button import AbortButton
from server.web.ui.bar.alarm_strip import AlarmStrip
from server.web.ui.bar.control_chip import ControlChip
from server.web.ui.bar.lamp_row import LampRow
from server.web.ui.bar.server_link import ServerLink
from server.web.ui.bar.state_chip import StateChip
from server.web.ui.bar.theme_button import ThemeButton


class Header:
    """Built once per page, refreshed by its timer."""

    def __init__(self, context: Context, abort_port: int) -> None:
        self._context = context
        with ui.header(elevated=False).classes("desk-bar q-pa-none"):
            with ui.element("div").classes("desk-row"):
                self._add_name()
                self._lamps = LampRow()
                ui.space()
                self._calibration = ui.label("").classes("calibration lockable")
                self._calibration.props('role=status aria-label="current calibration"')
                self._control = ControlChip(context)
                self._state = StateChip()
                self._link = ServerLink()
                ThemeButton()
                AbortButton(abort_port)
            self._alarms = AlarmStrip(context)

    def refresh(self) -> None:
        """Show what has changed."""
        self._lamps.show(self._context.lamps)
        self._state.show(self._context.desk.state)
        self._calibration.set_text(calibration_text(self._context))
        self._control.refresh()
        self._alarms.refresh()
        self._link.show(self._context.beat.number)

    def _add_name(self) -> None:
        config = self._context.services.config
        ui.icon("blur_on", size="26px").classes("text-primary")
        with ui.element("div").classes("desk-name"):
            ui.label("tomoshadow").classes("font-medium")
            ui.label(config.name).classes("text-xs")
        if config.simulation is not None:
            ui.label("SIMULATED").classes("simulated").tooltip("The devices of this rig are simulated")


def calibration_text(context: Context) -> str:
    """The calibration for new runs, how old it is, and by how much the views disagree, where that is known."""
    calibration = context.calibrations.current
    if calibration is None:
        return "no calibration"
    made_s, standing = context.calibrations.made_s(calibration), context.standing
    age = "" if made_s is None else f", {age_text(time.time() - made_s)} old"
    known = standing is not None and standing.calibration == calibration and bool(standing.views)
    drift = f", off by {max(standing.views.values()):.2f} px" if standing is not None and known else ""
    return f"{calibration}{age}{drift}"


def age_text(age_s: float) -> str:
    """A time in its largest unit."""
    for unit_s, unit in ((86_400, "d"), (3600, "h"), (60, "min")):
        if age_s >= unit_s:
            return f"{age_s / unit_s:.0f} {unit}"
    return f"{max(0.0, age_s):.0f} s"
