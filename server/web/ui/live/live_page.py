"""LivePage: look through all cameras before anything is recorded."""

from nicegui import ui

from server.lab.services import Context
from server.web.ui.draft import DraftStore
from server.web.ui.live.live_panel import LivePanel


class LivePage:
    """See ``DeskPage``."""

    def __init__(self, context: Context, draft: DraftStore) -> None:
        with ui.element("div").classes("columns one"):
            self._live = LivePanel(context, draft)

    async def refresh(self) -> None:
        """Follow the state of acquisition."""
        self._live.refresh()

    async def reload(self) -> None:
        """Nothing here is a list."""
