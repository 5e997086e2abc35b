"""CalibrationChip: the calibration for new runs. What is told of it stays in sight, however long its name is."""

import time

from nicegui import ui

from server.lab.services import Context
from server.web.ui.bar.age import age_text


class CalibrationChip:
    """Built once per page, refreshed by its timer."""

    def __init__(self, context: Context) -> None:
        self._context = context
        with ui.element("div").classes("calibration lockable") as self._chip:
            self._chip.props('role=status aria-label="current calibration"')
            self._name, self._told = ui.label("").classes("calibration-name"), ui.label("")

    def refresh(self) -> None:
        """Show what has changed."""
        name = self._context.calibrations.current or ""
        told = told_of(self._context, name) if name else []
        self._name.set_text(f"{name}," if told else name or "no calibration")
        self._told.set_text(" " + ", ".join(told) if told else "")
        if self._chip.props.get("title") != name:
            self._chip.props["title"] = name


def told_of(context: Context, calibration: str) -> list[str]:
    """How old it is, and by how much the views disagree, where that is known; or that it is gone."""
    made_s, standing = context.calibrations.made_s(calibration), context.standing
    if made_s is None:
        return ["its file is gone"]
    told = [f"{age_text(time.time() - made_s)} old"]
    if standing is not None and standing.calibration == calibration and standing.views:
        told.append(f"off by {max(standing.views.values()):.2f} px")
    return told
