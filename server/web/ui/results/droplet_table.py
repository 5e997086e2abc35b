"""DropletTable: the droplets of the shot that is shown, a row each; a click puts the cross-hair there."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from nicegui import ui

from daq.counted import counted
from processing.analysis.droplets.droplet_file import DIAMETER, StoredDroplets
from server.web.ui.results.slice_group import Dots
from server.web.ui.theme import panel

_SHOWN = 2000
_COLUMNS = {
    "exposure": "Exposure",
    "x_mm": "x, mm",
    "y_mm": "y, mm",
    "z_mm": "z, mm",
    "diameter_um": "Diameter, µm",
    "p_real": "Probability real",
}
_SHOWN_AS = {"exposure": "value", "diameter_um": "value.toFixed(value < 100 ? 1 : 0)", "p_real": "value.toFixed(2)"}
_UNKNOWN = "unknown"
_ROW = """
<q-tr :props="props" :tabindex="props.row.leads ? 0 : undefined" :class="{'cursor-pointer': props.row.leads}"
    @click="props.row.leads && $parent.$emit('pick', props.row)"
    @keydown.enter="$parent.$emit('pick', props.row)">
  <q-td v-for="one in props.cols" :key="one.name" :props="props">{{ one.value }}</q-td>
</q-tr>"""
_HEAD = """<q-th :props="props" tabindex="0" @keydown.enter="props.sort(props.col)">{{ props.col.label }}</q-th>"""
"""By themselves rows and heads of a table hear no keys."""


class DropletTable:
    """Built once per page; hidden where the shot is not measured."""

    def __init__(self, go_to: Callable[[tuple[float, float, float], str], None]) -> None:
        self._go_to = go_to
        with panel("Droplets of this shot") as self._panel:
            self._count = ui.label("").classes("text-sm")
            columns = [
                {
                    "name": name,
                    "label": label,
                    "field": name,
                    "align": "left",
                    "sortable": True,
                    ":format": _shown(name),
                }
                for name, label in _COLUMNS.items()
            ]
            self._table = ui.table(columns=columns, rows=[], row_key="id", pagination=10).classes("w-full")
            self._table.props("dense flat")
            self._table.add_slot("header-cell", _HEAD)
            self._table.add_slot("body", _ROW)
            self._table.on("pick", self._on_row)
        self._panel.set_visibility(False)

    def show(self, droplets: StoredDroplets | None, leads: bool) -> None:
        """Show those of another shot, or none; rows lead to their places where there is a volume to see them in."""
        rows = [row | {"leads": leads} for row in droplet_rows(droplets)] if droplets else []
        self._panel.set_visibility(droplets is not None)
        where = "a row leads to its place" if leads else "choose volumes above to see where they lie"
        self._count.set_text(f"{count_text(droplets)}; {where}")
        self._table.rows = rows
        self._table.update()

    def _on_row(self, event: Any) -> None:
        row = event.args
        self._go_to((float(row["x_mm"]), float(row["y_mm"]), float(row["z_mm"])), str(row["exposure"]).lower())


def count_text(droplets: StoredDroplets | None) -> str:
    """How many there are, and how many of them the table lists."""
    there = len(droplets.columns["frame"]) if droplets else 0
    which = "largest" if droplets and DIAMETER in droplets.columns else "first"
    return counted(there, "droplet") + (f", the {which} {_SHOWN} are listed" if there > _SHOWN else "")


def droplet_rows(droplets: StoredDroplets) -> list[dict[str, Any]]:
    """Rows of the table: the largest ones first where diameters are known."""
    columns = {name: droplets.columns[name] for name in _COLUMNS if name in droplets.columns}
    frames = droplets.columns["frame"].astype("U1")
    order = np.arange(len(frames))
    if DIAMETER in columns:
        order = np.argsort(-np.nan_to_num(columns["diameter_um"].astype(np.float64)), kind="stable")
    rows = []
    for number in order[:_SHOWN].tolist():
        told = {name: _number(float(values[number])) for name, values in columns.items()}
        rows.append({"id": number, "exposure": frames[number].upper()} | told)
    return rows


def _shown(name: str) -> str:
    """How the browser writes a value: as text it would sort 12 before 9."""
    return f"value => value == null ? '{_UNKNOWN}' : {_SHOWN_AS.get(name, 'value.toFixed(3)')}"


def _number(value: float) -> float | None:
    """What JSON has for a number that nobody knows."""
    return value if math.isfinite(value) else None


def dots_of(droplets: StoredDroplets | None) -> Dots:
    """Places of droplets by exposure."""
    if droplets is None:
        return {}
    points_mm = np.stack([droplets.columns[f"{axis}_mm"].astype(np.float64) for axis in "xyz"], axis=1)
    frames = droplets.columns["frame"].astype("U1")
    return {str(frame): points_mm[frames == frame] for frame in np.unique(frames)}
