"""StateChip: the state of the rig in one word; a click tells everything that speaks against a start."""

from nicegui import ui

from daq.counted import counted
from server.lab.desk.rig_state import RigState, RigWord

_COLOURS = {
    RigWord.READY: "good",
    RigWord.NOT_READY: "warn",
    RigWord.LIVE: "busy",
    RigWord.ARMING: "busy",
    RigWord.ACQUIRING: "busy",
    RigWord.DISARMING: "busy",
    RigWord.FAULT: "bad",
}


class StateChip:
    """Built once per page."""

    def __init__(self) -> None:
        self._shown: RigState | None = None
        self._chip = ui.element("div").classes("rig-state lockable").props('role=status aria-label="rig state"')
        with self._chip:
            self._text = ui.label("").classes("rig-known").props("tabindex=0")
            ui.label("").classes("rig-unknown")
        with ui.link(target="/run").classes("rig-form lockable").props('aria-label="to the form"') as self._to_form:
            ui.icon("edit_note", size="24px")
        self._to_form.set_visibility(False)
        with ui.button(icon="help_outline").props('flat round dense color=white aria-label="why this state"') as why:
            why.classes("lockable")
            with ui.menu().props('role=region aria-label="reasons against a start"'):
                self._reasons = ui.column().classes("q-pa-md gap-2").style("max-width:min(560px, 90vw)")

    def show(self, state: RigState, *, is_of_form: bool) -> None:
        """Show what has changed; of the form of the next run, or of the rig alone."""
        self._to_form.set_visibility(is_of_form and state.state is RigWord.NOT_READY)
        if state == self._shown:
            return
        if self._shown is None or state.reasons != self._shown.reasons:
            self._show_reasons(state)
        self._shown = state
        self._text.set_text(state.text)
        self._chip.classes(replace=f"rig-state lockable {_COLOURS[state.state]}")

    def _show_reasons(self, state: RigState) -> None:
        self._reasons.clear()
        with self._reasons:
            if not state.reasons:
                ui.label("Nothing speaks against a start.")
            for reason in state.reasons:
                with ui.column().classes("gap-0"):
                    ui.label(reason.text).classes("font-medium")
                    ui.label(f"Do: {reason.remedy}").classes("text-sm")


def in_brief(state: RigState, alarms: int) -> str:
    """The state without reason and remaining time, and how many alarms are loud, for the narrow tab of a browser."""
    told = state.text.partition(":" if state.state is RigWord.NOT_READY else ",")[0]
    return f"{told}, {counted(alarms, 'alarm')}" if alarms else told
