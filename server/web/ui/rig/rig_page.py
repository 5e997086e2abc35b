"""RigPage: every device of the rig, what it says of itself, and when it last did."""

from nicegui import ui

from server.lab.services import Context
from server.web.ui.theme import panel


class RigPage:
    """See ``DeskPage``."""

    def __init__(self, context: Context) -> None:
        self._context = context
        with ui.element("div").classes("columns one"), panel("Devices"):
            self._devices = ui.column().classes("w-full")

    async def refresh(self) -> None:
        """Show what the devices say now."""
        self._devices.clear()
        with self._devices:
            for lamp in self._context.lamps:
                ui.label(f"{lamp.name}: {lamp.health}, {lamp.detail}")

    async def reload(self) -> None:
        """Nothing here is a list."""
