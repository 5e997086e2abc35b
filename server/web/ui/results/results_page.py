"""ResultsPage: volumes, and what was measured in them."""

from nicegui import ui

from server.lab.services import Context
from server.web.ui.results.droplet_panel import DropletPanel
from server.web.ui.results.volume_panel import VolumePanel


class ResultsPage:
    """See ``DeskPage``."""

    def __init__(self, context: Context) -> None:
        with ui.element("div").classes("columns one"):
            self._volume, self._droplets = VolumePanel(context), DropletPanel(context)

    async def refresh(self) -> None:
        """Everything here is a list."""

    async def reload(self) -> None:
        """Offer the volumes and measurements that exist now."""
        await self._volume.reload()
        await self._droplets.reload()
