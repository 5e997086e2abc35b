"""AlarmStrip: what is wrong, one line per cause, each with its remedy; acknowledged one by one."""

from functools import partial

from nicegui import ui
from starlette.concurrency import run_in_threadpool

from daq.errors import DaqError
from server.lab.desk.alarms import Alarm
from server.lab.errors import ServerError
from server.lab.services import Context
from server.lab.starting.alarms_now import acknowledge
from server.lab.starting.command import tell_deed
from server.web.ui.visiting import for_operators, require_operator, told


class AlarmStrip:
    """Built once per page, refreshed by its timer; there only while there is an alarm."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._shown: tuple[Alarm, ...] = ()
        self._strip = ui.column().classes("alarm-strip lockable gap-0").props('role=region aria-label="alarms"')
        self._strip.set_visibility(False)

    @property
    def loud(self) -> int:
        """How many nobody has acknowledged."""
        return sum(not alarm.acknowledged for alarm in self._shown)

    def refresh(self) -> None:
        """Show what has changed."""
        alarms = tuple(sorted(self._context.desk.alarms, key=lambda alarm: (alarm.acknowledged, not alarm.severe)))
        if alarms == self._shown:
            return
        self._shown = alarms
        self._strip.set_visibility(bool(alarms))
        self._strip.clear()
        with self._strip:
            for alarm in alarms:
                self._show(alarm)

    def _show(self, alarm: Alarm) -> None:
        kind = "seen" if alarm.acknowledged else "stop" if alarm.severe else "warn"
        with ui.row().classes(f"alarm {kind} items-center no-wrap").props("role=alert"):
            ui.icon("warning", size="18px")
            with ui.element("div").classes("alarm-text"):
                ui.label(f"{alarm.source}: {alarm.text}").classes("font-medium")
                ui.label(alarm.remedy).classes("alarm-remedy")
            if not alarm.acknowledged:
                button = ui.button("Acknowledge", on_click=partial(self._on_acknowledge, alarm.id), color=None)
                button.props("dense flat no-caps").classes("alarm-button")
                button.props["aria-label"] = f"Acknowledge {alarm.source}: {alarm.text}"
                for_operators(button)

    async def _on_acknowledge(self, alarm_id: str) -> None:
        try:
            who = require_operator()
            await run_in_threadpool(acknowledge, self._context, alarm_id)
            tell_deed(self._context, who, "acknowledged an alarm")
        except (DaqError, ServerError) as error:
            ui.notify(told(error), type="negative")
