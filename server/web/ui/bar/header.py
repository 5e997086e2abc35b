"""Header: what is always in sight. Which rig, its lamps, state and calibration, who holds control, ABORT, alarms."""

from nicegui import ui

from server.lab.services import Context
from server.lab.starting.preflight_list import OF_THE_RIG
from server.web.ui.bar.abort_button import AbortButton
from server.web.ui.bar.alarm_strip import AlarmStrip
from server.web.ui.bar.calibration_chip import CalibrationChip
from server.web.ui.bar.control_chip import ControlChip
from server.web.ui.bar.lamp_row import LampRow
from server.web.ui.bar.server_link import ServerLink
from server.web.ui.bar.state_chip import StateChip, in_brief
from server.web.ui.bar.theme_button import ThemeButton
from server.web.ui.form_judge import FormJudge
from server.web.ui.visiting import visitor


class Header:
    """Built once per page, refreshed by its timer."""

    def __init__(self, context: Context, judge: FormJudge, abort_port: int) -> None:
        self._context, self._judge = context, judge
        self.page = ""
        """Title of the page that is open."""
        with ui.header(elevated=False).classes("desk-bar q-pa-none"):
            with ui.element("div").classes("desk-row"):
                self._add_name()
                self._lamps = LampRow()
                ui.space()
                self._calibration = CalibrationChip(context)
                self._control = ControlChip(context)
                self._state = StateChip()
                self._link = ServerLink()
                ThemeButton()
                AbortButton(abort_port)
            self._alarms = AlarmStrip(context)

    def refresh(self) -> None:
        """Show what has changed."""
        self._lamps.show(self._context.lamps)
        state = self._judge.state(visitor())
        self._state.show(state, is_of_form=any(reason.code not in OF_THE_RIG for reason in state.reasons))
        self._calibration.refresh()
        self._control.refresh()
        self._alarms.refresh()
        place = f"{self.page} · {self._context.services.config.name}"
        self._link.show(self._context.beat.number, in_brief(state, self._alarms.loud), place)

    def _add_name(self) -> None:
        config = self._context.services.config
        ui.icon("blur_on", size="26px").classes("text-primary")
        with ui.element("div").classes("desk-name") as name:
            name.props["title"] = config.name  # there is not always room for all of it
            ui.label("tomoshadow").classes("font-medium")
            ui.label(config.name).classes("text-xs")
        if config.simulation is not None:
            ui.label("SIMULATED").classes("simulated").tooltip("The devices of this rig are simulated")
