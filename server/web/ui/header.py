"""Header of the page: which rig, its lamps, the state of acquisition, dark or light."""

from nicegui import ui

from daq.run.state import RunState
from server.lab.duty import Lamp
from server.lab.services import Context

_STATE_COLOURS = {
    RunState.IDLE: "positive",
    RunState.LIVE: "primary",
    RunState.ARMING: "warning",
    RunState.ACQUIRING: "primary",
    RunState.DISARMING: "warning",
    RunState.FAULT: "negative",
}


class Header:
    """Built once per page, refreshed by its timer."""

    def __init__(self, context: Context, dark: ui.dark_mode) -> None:
        self._context = context
        self._shown: tuple[str, ...] = ()
        config = context.services.config
        with (
            ui.header(elevated=False)
            .classes("items-center q-py-none q-px-md gap-3")
            .style("background:#10161e;min-height:52px;padding:4px 16px")
        ):
            ui.icon("blur_on", size="26px").classes("text-primary")
            ui.label("tomoshadow").classes("text-lg font-medium")
            ui.label(config.name).classes("text-sm opacity-60")
            self._lamps = ui.row().classes("gap-2 items-center").props('role=group aria-label="rig status"')
            ui.space()
            self._state = (
                ui.badge("").props('role=status aria-label="acquisition state"').classes("text-sm q-px-md q-py-xs")
            )
            ui.button(icon="contrast", on_click=dark.toggle).props(
                'flat round dense color=white aria-label="dark or light"'
            )

    def refresh(self) -> None:
        """Show what has changed."""
        state = self._context.services.acquisition.status().state
        self._state.set_text(state.upper())
        self._state.props(f"color={_STATE_COLOURS[state]}")
        lamps = self._context.lamps
        texts = tuple(f"{lamp.name}: {lamp.health}, {lamp.detail}" for lamp in lamps)
        if texts != self._shown:
            self._shown = texts
            self._lamps.clear()
            with self._lamps:
                for lamp, text in zip(lamps, texts, strict=True):
                    _show(lamp, text)


def _show(lamp: Lamp, text: str) -> None:
    chip = ui.element("div").classes("lamp-chip").props("role=status")
    chip.props["aria-label"] = text  # whatever it says: a parser of props would stumble over quotes and lines
    with chip:
        ui.element("span").classes(f"lamp {lamp.health}")
        ui.label(lamp.name if lamp.kind != "disk" else lamp.detail)
        ui.tooltip(text)
