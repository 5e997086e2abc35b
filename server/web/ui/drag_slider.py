"""DragSlider: a slider that tells the server once, when it is let go; the number beside its thumb follows meanwhile."""

from collections.abc import Awaitable, Callable
from typing import Any

from nicegui.elements.mixins.disableable_element import DisableableElement
from nicegui.events import GenericEventArguments

_SECOND = 1.0


class DragSlider(DisableableElement):
    """One request for a drag, however long.

    Parameters
    ----------
    value, low, high, step : float
        In the unit of the value.
    on_release : Callable[[Any], Awaitable[None] | None]
        Gets the event; its ``args`` are what ``js_handler`` emits, by default the value.
    js_handler : str
        Function of the browser that takes the new value.
    """

    def __init__(
        self,
        value: float,
        low: float,
        high: float,
        step: float,
        on_release: Callable[[GenericEventArguments], Awaitable[None] | None],
        js_handler: str = "(value) => emit(value)",
    ) -> None:
        super().__init__(tag="q-slider")
        self._props |= {"model-value": value, "min": low, "max": high, "step": step, "label": True, "loopback": False}
        # The browser moves the thumb by itself, as long as there is somebody who could be told.
        self.on("update:model-value", _ignore, [None], throttle=_SECOND, leading_events=False, trailing_events=False)
        self.on("change", on_release, js_handler=js_handler)

    def set_value(self, value: float) -> None:
        """Move the thumb."""
        if self._props["model-value"] != value:
            self._props["model-value"] = value
            self.update()


def _ignore(_: Any) -> None:
    """Nobody is told while it moves."""
