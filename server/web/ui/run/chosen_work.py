"""ChosenWork: what is made of every shot of the next run by itself; it becomes the recipe of its plan."""

from collections.abc import Callable
from typing import Any

from nicegui import ui

from daq.run_plan import RunKind
from processing.reconstruction.choices import ReconstructionMethod
from server.web.ui.draft import NO_VOLUMES, DraftStore
from server.web.ui.visiting import for_operators

WHERE = (
    "A flat box behind the break-up, x, y and z from:to in mm, which holds all of the spray at its height. Where it is "
    "empty, all that the views see is searched: where liquid still hangs together that takes minutes a shot, and ends "
    "in a refusal."
)
_VOLUMES = {NO_VOLUMES: "none"} | {one.value: f"by {one.value.upper()}" for one in ReconstructionMethod}


class ChosenWork:
    """Built once per page.

    Parameters
    ----------
    draft : DraftStore
        What is chosen.
    changed : Callable[[], None]
        Called after each choice.
    """

    def __init__(self, draft: DraftStore, changed: Callable[[], None]) -> None:
        self._draft, self._changed = draft, changed
        with ui.column().classes("w-full gap-1") as self._box:
            self._build()

    def _build(self) -> None:
        values = self._draft.values
        with ui.row().classes("w-full items-center no-wrap gap-2"):
            self._volumes = ui.select(
                _VOLUMES,
                label="Volumes",
                value=values["volumes"],
                on_change=lambda event: self._keep("volumes", event.value),
            )
            self._volumes.props("dense outlined options-dense").classes("grow").tooltip("Made of every shot by itself")
            self._droplets = ui.checkbox(
                "Droplets too",
                value=values["droplets"],
                on_change=lambda event: self._keep("droplets", event.value),
            )
            self._droplets.props('aria-label="Droplets too"')
            self._droplets.tooltip("Measured in every shot by itself, against the background run")
        with ui.column().classes("w-full gap-1").bind_visibility_from(self._droplets, "value"):
            self._where = ui.input(
                "Box of the droplets / mm",
                value=values["droplet_box"],
                placeholder="-5:5,-1:0,-5:5",
                on_change=lambda event: self._keep("droplet_box", event.value),
            )
            self._where.props('dense outlined stack-label data-draft="droplet_box"').classes("w-full")
            ui.label(WHERE).classes("text-xs opacity-80")

    def show_kind(self, kind: RunKind) -> None:
        """Nothing is made of any other run than one of the spray."""
        self._box.set_visibility(kind is RunKind.SAMPLE)

    def allow(self, why: str) -> None:
        """Nobody chooses while somebody else holds control; why, where that is so."""
        for field in (self._volumes, self._droplets, self._where):
            for_operators(field, why=why)

    def show(self) -> None:
        """Show what is chosen, here or in another tab."""
        self._volumes.set_value(self._draft.values["volumes"])
        self._droplets.set_value(self._draft.values["droplets"])
        self._where.set_value(self._draft.values["droplet_box"])

    def _keep(self, name: str, value: Any) -> None:
        if value != self._draft.values[name]:
            self._draft.set(name, value)
            self._changed()
