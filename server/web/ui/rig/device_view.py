"""DeviceView: the card of one device; its elements are made once, and texts change when the device does."""

from functools import partial

from nicegui import ui

from server.lab.devices.device_cards import DeviceCard
from server.lab.monitor import STALE_S
from server.lab.services import Context
from server.web.ui.asking import try_to
from server.web.ui.bar.age import age_text
from server.web.ui.visiting import for_operators

_ICONS = {
    "camera": "videocam",
    "generator": "bolt",
    "interlock": "lock",
    "stage": "height",
    "disk": "storage",
    "simulator": "memory",
    "work": "engineering",
}
_STATES = {"ok": "ok", "warn": "look at it", "fault": "fault"}


class DeviceView:
    """Built once per page and device."""

    def __init__(self, context: Context, card: DeviceCard) -> None:
        self._context = context
        self._shown: DeviceCard | None = None
        with ui.card().classes("panel device-card").props("role=region") as self._box:
            self._box.props["aria-label"] = card.name
            with ui.row().classes("w-full items-center no-wrap gap-2"):
                self._dot = ui.element("span").classes("lamp")
                ui.icon(_ICONS[card.kind], size="20px").classes("opacity-70")
                ui.label(card.name).classes("text-base font-medium flex-1 min-w-0")
                self._state = ui.badge("").props("role=status")
            self._who = ui.label("").classes("text-sm opacity-80")
            self._detail = ui.label("").classes("text-sm device-detail")
            self._remedy = ui.label("").classes("refusal")
            with ui.grid(columns="auto minmax(0,1fr)").classes("device-limits"):
                for limit in card.limits:
                    ui.label(limit.what).classes("opacity-70")
                    ui.label(limit.value)
            ui.space()
            with ui.row().classes("w-full items-center no-wrap gap-2"):
                self._age = ui.label("").classes("text-xs opacity-70 flex-1")
                self._button = ui.button("Reconnect", icon="refresh", on_click=partial(self._reconnect, card.name))
                self._button.props("outline dense no-caps size=sm")
                with self._button:
                    self._why = ui.tooltip("")
        self._button.set_visibility(card.kind in ("camera", "generator", "stage"))
        self.show(card)

    def show(self, card: DeviceCard) -> None:
        """Show what has changed."""
        self._age.set_text(_age(card))
        said = card.model_copy(update={"age_s": None})
        if said == self._shown:
            return
        self._shown = said
        self._dot.classes(replace=f"lamp {card.health}")
        self._state.set_text(_STATES[card.health])
        self._state.props(f"color={_colour(card)}")
        self._who.set_text(_who(card))
        self._detail.set_text("" if card.detail and card.detail in _who(card) else card.detail)
        self._remedy.set_text(f"Do: {card.remedy}" if card.remedy else "")
        for label in (self._who, self._detail, self._remedy):
            label.set_visibility(bool(label.text))
        for_operators(self._button, card.can_reconnect)
        self._why.set_text(
            "Ask now, and open it again if it was lost; it is tried every second by itself"
            if card.can_reconnect
            else "Between runs only: end what goes on"
        )

    async def _reconnect(self, name: str) -> None:
        await try_to(lambda: self._context.monitor.reconnect(name))


def _who(card: DeviceCard) -> str:
    known = card.identity
    return f"{known.vendor} {known.model}, {known.serial}, firmware {known.firmware}" if known else ""


def _age(card: DeviceCard) -> str:
    if card.kind == "work":
        return ""
    if card.age_s is None:
        return "has not answered yet"
    return "answers" if card.age_s < STALE_S else f"last answer {age_text(card.age_s)} ago"


def _colour(card: DeviceCard) -> str:
    return {"ok": "positive", "warn": "warning text-color=dark", "fault": "negative"}[card.health]
