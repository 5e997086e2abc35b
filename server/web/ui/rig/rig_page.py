"""RigPage: every device of the rig, what it says of itself, and when it last did; network and doctor."""

from nicegui import ui

from server.lab.devices.device_cards import by_name, device_cards
from server.lab.services import Context
from server.web.ui.draft import DraftStore
from server.web.ui.rig.device_view import DeviceView
from server.web.ui.rig.doctor_panel import DoctorPanel
from server.web.ui.rig.link_panel import LinkPanel


class RigPage:
    """See ``DeskPage``."""

    def __init__(self, context: Context, draft: DraftStore) -> None:
        self._context = context
        with ui.element("div").classes("columns one"):
            with ui.element("div").classes("device-cards"):
                self._devices = {card.name: DeviceView(context, card) for card in device_cards(context)}
            with ui.element("div").classes("rig-panels"):
                self._link = LinkPanel(context, draft)
                self._doctor = DoctorPanel(context)

    async def refresh(self) -> None:
        """Show what the devices say now."""
        cards = by_name(device_cards(self._context))
        for name, view in self._devices.items():
            view.show(cards[name])
        self._link.refresh()
        self._doctor.refresh()

    async def reload(self) -> None:
        """Nothing here is a list."""
