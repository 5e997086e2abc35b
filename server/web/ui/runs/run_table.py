"""RunTable: the newest runs of some kinds, and what can be made of each at once."""

import asyncio
from typing import Any

from daq.run_plan import RunKind
from server.lab.jobs import calibration_job
from server.lab.runs.run_filter import RunFilter
from server.lab.runs.run_summary import ACTIVE, RunSummary
from server.lab.services import Context
from server.web.ui.asking import queue
from server.web.ui.runs.run_rows import run_row
from server.web.ui.table import table_of
from server.web.ui.theme import panel

_CALIBRATE = "Calibrate"
_SHOWN = 60


class RunTable:
    """Runs, newest first; a calibration run can be fitted."""

    def __init__(self, context: Context, kinds: tuple[RunKind, ...] = tuple(RunKind)) -> None:
        self._context, self._kinds = context, kinds
        with panel("Runs", "flex-1"):
            self._table = table_of(
                ("id", "Run"),
                ("kind", "Kind"),
                ("shots", "Valid / planned"),
                ("outcome", "Outcome"),
                ("actions", ""),
            )
            self._table.on("act", self._on_act)

    async def reload(self) -> None:
        """Read the run directories again."""
        runs = await asyncio.to_thread(self._newest)
        self._table.rows = [row_with_actions(run) for run in runs]
        self._table.update()

    def _newest(self) -> list[RunSummary]:
        found = [run for kind in self._kinds for run in self._context.runs.page(_SHOWN, 0, RunFilter(kind=kind))[0]]
        return sorted(found, key=lambda run: run.created_utc, reverse=True)[:_SHOWN]

    async def _on_act(self, event: Any) -> None:
        run_id = event.args["id"]
        job = calibration_job(run_id, f"{run_id}-pinhole", "pinhole")
        await queue(lambda: [self._context.runner.submit(job)])


def row_with_actions(run: RunSummary) -> dict[str, Any]:
    """One run in the table."""
    can_be_fitted = run.kind is RunKind.CALIBRATION and run.outcome != ACTIVE
    return run_row(run) | {"actions": [_CALIBRATE] if can_be_fitted else []}
