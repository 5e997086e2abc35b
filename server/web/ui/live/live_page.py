"""LivePage: look through all cameras before anything is recorded, and set light and lenses."""

from nicegui import ui

from server.lab.services import Context
from server.web.ui.draft import DraftStore
from server.web.ui.live.light_panel import LightPanel
from server.web.ui.live.live_panel import LivePanel
from server.web.ui.live.timing_panel import TimingPanel
from server.web.ui.live.volume_panel import LiveVolumePanel


class LivePage:
    """See ``DeskPage``."""

    def __init__(self, context: Context, draft: DraftStore) -> None:
        with ui.element("div").classes("columns live-page"):
            with ui.element("div").classes("column").props("tabindex=0"):
                self._live = LivePanel(context, draft)
                self._volume = LiveVolumePanel(context)
            with ui.element("div").classes("column side"):
                self._light = LightPanel(context, draft, self._live.apply)
                self._timing = TimingPanel(context, draft)

    async def refresh(self) -> None:
        """Follow the state of acquisition and the light of the form."""
        self._live.refresh()
        self._light.refresh()
        self._volume.refresh()
        await self._timing.refresh()

    async def reload(self) -> None:
        """Nothing here is a list."""
