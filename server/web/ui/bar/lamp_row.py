"""LampRow: a lamp per device where there is room, and their sum where there is not."""

from collections.abc import Sequence

from nicegui import ui

from daq.counted import counted
from server.lab.duty import Health, Lamp


class LampRow:
    """Built once per page."""

    def __init__(self) -> None:
        self._shown: tuple[str, ...] = ()
        self._row = ui.row().classes("lamps gap-2 items-center lockable").props('role=group aria-label="rig status"')
        with (
            ui.element("div").classes("lamp-sum lamp-chip lockable").props('role=status aria-label="sum of all lamps"')
        ):
            self._dot = ui.element("span").classes("lamp")
            self._sum = ui.label("")
            self._tooltip = ui.tooltip("").classes("lamp-list")

    def show(self, lamps: Sequence[Lamp]) -> None:
        """Show what has changed."""
        texts = tuple(f"{lamp.name}: {lamp.health}, {lamp.detail}" for lamp in lamps)
        if texts == self._shown:
            return
        self._shown = texts
        self._sum.set_text(_sum_of(lamps))
        self._dot.classes(replace=f"lamp {_worst_of(lamps)}")
        self._tooltip.set_text("\n".join(texts))
        self._row.clear()
        with self._row:
            for lamp, text in zip(lamps, texts, strict=True):
                _show(lamp, text)


def _sum_of(lamps: Sequence[Lamp]) -> str:
    """All lamps in two words."""
    faults = sum(lamp.health is Health.FAULT for lamp in lamps)
    warnings = sum(lamp.health is Health.WARN for lamp in lamps)
    if faults:
        return counted(faults, "fault")
    return f"{warnings} of {len(lamps)} amber" if warnings else f"{len(lamps)} ok"


def _worst_of(lamps: Sequence[Lamp]) -> Health:
    """The colour of them all."""
    healths = {lamp.health for lamp in lamps}
    return next((health for health in (Health.FAULT, Health.WARN) if health in healths), Health.OK)


def _show(lamp: Lamp, text: str) -> None:
    chip = ui.element("div").classes("lamp-chip").props("role=status")
    chip.props["aria-label"] = text  # whatever it says: a parser of props would stumble over quotes and lines
    with chip:
        ui.element("span").classes(f"lamp {lamp.health}")
        ui.label(lamp.name if lamp.kind != "disk" else lamp.detail)
        ui.tooltip(text)
