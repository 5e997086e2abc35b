"""DoctorPanel: looks at computer, network and devices when somebody asks, and lists what it found."""

import asyncio
import time
from collections.abc import Sequence

from nicegui import ui

from daq.counted import counted
from server.doctor.checkup import Checkup, Status
from server.lab.devices.rig_doctor import examine
from server.lab.services import Context
from server.web.ui.asking import try_to
from server.web.ui.theme import panel
from server.web.ui.visiting import for_operators

_LAMPS = {Status.OK: "ok", Status.WARN: "warn", Status.FAIL: "fault"}


class DoctorPanel:
    """Built once per page, refreshed by its timer."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._is_looking = False
        with panel("Doctor"):
            with ui.row().classes("w-full items-center gap-3"):
                self._button = ui.button("Examine", icon="medical_services", on_click=self._on_click)
                self._button.props("outline dense no-caps")
                self._told = ui.label("").classes("text-sm flex-1").props('role=status aria-label="doctor"')
            self._why = ui.label("Between runs only: end what goes on.").classes("text-xs opacity-70")
            self._list = ui.element("div").classes("doctor-list")
        self._told.set_text(
            "Looks at computer, network and devices, as tomoshadow doctor does; takes some seconds, no light."
        )
        self.refresh()

    def refresh(self) -> None:
        """Follow the state of acquisition."""
        resting = self._context.services.acquisition.status().resting
        for_operators(self._button, resting and not self._is_looking)
        self._why.set_visibility(not resting)

    async def _on_click(self) -> None:
        self._is_looking = True
        self._told.set_text("looking ...")
        self.refresh()
        try:
            await try_to(self._look)
        finally:
            self._is_looking = False
            self.refresh()

    async def _look(self) -> None:
        found = await asyncio.to_thread(examine, self._context)
        self._told.set_text(f"{summary_of(found)}, at {time.strftime('%H:%M:%S')}")
        self._list.clear()
        with self._list:
            for one in sorted(found, key=lambda one: list(Status).index(one.status), reverse=True):
                _show(one)


def summary_of(found: Sequence[Checkup]) -> str:
    """All findings in a few words."""
    counts = {status: sum(one.status is status for one in found) for status in Status}
    told = [f"{counts[status]} {word}" for status, word in ((Status.FAIL, "failed"), (Status.WARN, "to look at"))]
    return f"{counted(len(found), 'thing')} looked at: {', '.join(told)}"


def _show(one: Checkup) -> None:
    with ui.element("div").classes("doctor-row"):
        ui.element("span").classes(f"lamp {_LAMPS[one.status]}").props(f"role=img aria-label={one.status}")
        ui.label(one.name).classes("font-medium")
        with ui.column().classes("gap-0 min-w-0"):
            ui.label(one.detail).classes("device-detail")
            if one.remedy:
                ui.label(f"Do: {one.remedy}").classes("refusal")
