"""DropletPanel: what was measured of the droplets of a run, a line per result set; hidden until something was."""

import asyncio
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from nicegui import ui

from daq.counted import counted
from processing.analysis.estimates import Estimate
from server.lab.droplets.measured import MeasuredRun, measured_run
from server.lab.errors import ServerError
from server.lab.results import ResultSet
from server.lab.services import Context
from server.web.ui.theme import panel

_SHOWN = 8
_COLUMNS = {
    "results": "Result set",
    "droplets": "Droplets",
    "density": "per mm³",
    "d32": "D32, µm",
    "ghosts": "Ghosts, %",
    "verdict": "Verdict",
    "not_checked": "Not checked",
}
_LONG = '<q-td :props="props"><div class="verdict {}" tabindex="0">{{{{ props.value }}}}</div></q-td>'
"""Reasons may be many lines: they scroll."""


class DropletPanel:
    """Built once per page."""

    def __init__(self, context: Context) -> None:
        self._context = context
        with panel("Droplets") as self._panel:
            columns = [
                {"name": name, "label": label, "field": name, "align": "left"} for name, label in _COLUMNS.items()
            ]
            self._table = ui.table(columns=columns, rows=[], row_key="id").classes("w-full")
            self._table.props('dense flat wrap-cells hide-bottom :pagination="{rowsPerPage: 0}"')
            self._table.add_slot("body-cell-verdict", _LONG.format(""))
            self._table.add_slot("body-cell-not_checked", _LONG.format("unchecked"))
        self._panel.set_visibility(False)

    async def show(self, run_id: str, sets: Sequence[ResultSet]) -> None:
        """Tell of the result sets of a run; they are read again where their files have changed."""
        measured = [one.id for one in sets if one.droplets][:_SHOWN]
        rows = await asyncio.to_thread(lambda: [self._row(run_id, results_id) for results_id in measured])
        if more := sum(bool(one.droplets) for one in sets) - len(rows):
            rows.append({"id": "", "results": f"and {counted(more, 'older set')}, not told here"})
        self._panel.set_visibility(bool(rows))
        self._table.rows = rows
        self._table.update()

    def _row(self, run_id: str, results_id: str) -> dict[str, Any]:
        try:
            results_dir = self._context.runs.directory(run_id) / "results" / results_id
            run = measured_run(results_dir)
        except ServerError as error:
            return {"id": results_id, "results": results_id, "verdict": str(error)}
        return {"id": results_id, "results": results_id, **droplet_row(run)}


def droplet_row(run: MeasuredRun) -> dict[str, str]:
    """Cells of a result set: each number with its interval, or why there is none."""
    statistics, shots = run.statistics, told_shots([one.shot for one in run.shots])
    return {
        "droplets": f"{statistics.n} in {counted(statistics.exposures, 'exposure')} of {shots}",
        "density": _told(statistics.number_density_per_mm3, statistics.number_density_reason),
        "d32": _told(statistics.d32_um, statistics.reason),
        "ghosts": _told(statistics.ghost_share, statistics.ghost_reason, _percent),
        "verdict": _verdicts(run),
        "not_checked": "; ".join(one.what for one in run.together.not_checked),
    }


def told_shots(shots: Sequence[int]) -> str:
    """Which shots are measured, so that one of them can be chosen."""
    if len(shots) == 1:
        return f"shot {shots[0]}"
    low, high = min(shots), max(shots)
    told = "shots" if high - low + 1 == len(shots) else f"{counted(len(shots), 'shot')} from"
    return f"{told} {low} to {high}"


def _told(estimate: Estimate | None, reason: str | None, written: Callable[[float], str] = "{:.3g}".format) -> str:
    if estimate is None:
        return reason or ""
    value, low, high = map(written, (estimate.value, estimate.low, estimate.high))
    return f"{value} ({low} to {high})"


def _percent(share: float) -> str:
    return f"{100 * share:.2f}"


def _verdicts(run: MeasuredRun) -> str:
    """How many shots are good, of all others the reasons, each with its shots, and what they say together."""
    counts = Counter(str(shot.verdict) for shot in run.shots)
    reasons: dict[str, list[int]] = {}
    for shot in run.shots:
        for reason in shot.reasons:
            reasons.setdefault(reason, []).append(shot.shot)
    told = [f"shot {', '.join(map(str, shots))}: {reason}" for reason, shots in reasons.items()]
    good = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    return "; ".join([good, *told, *run.doubts])
