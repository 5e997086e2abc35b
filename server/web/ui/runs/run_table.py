"""RunTable: runs with their outcomes, and what can be made of each."""

import asyncio
from typing import Any

from nicegui import ui

from daq.run.state import RunOutcome
from daq.run_plan import RunKind
from processing.reconstruction.choices import Accuracy, VoxelType
from processing.reconstruction.choices import ReconstructionMethod as Method
from processing.reconstruction.settings import ReconstructionSettings
from server.lab.droplets.measurement import request_measurement
from server.lab.jobs import Job, calibration_job
from server.lab.reconstruction import request_reconstruction
from server.lab.runs.run_summary import ACTIVE, DAMAGED, RunSummary
from server.lab.services import Context
from server.web.ui.asking import queue
from server.web.ui.run.run_panel import outcome_colour
from server.web.ui.table import table_of
from server.web.ui.theme import panel

_CALIBRATE, _RECONSTRUCT, _MEASURE = "Calibrate", "Reconstruct", "Measure"
_ACTIONS_OF = {RunKind.CALIBRATION: [_CALIBRATE], RunKind.SAMPLE: [_RECONSTRUCT, _MEASURE], None: []}
_SHOWN = 60


class RunTable:
    """Runs, newest first; a calibration run can be fitted, a sample run reconstructed as chosen, or measured."""

    def __init__(self, context: Context, kinds: tuple[RunKind, ...] = tuple(RunKind)) -> None:
        self._context, self._kinds = context, kinds
        with panel("Runs", "flex-1"):
            with ui.row().classes("w-full items-center justify-between no-wrap q-mt-none"):
                ui.label("Reconstruct by").classes("text-xs opacity-70")
                chosen = context.services.settings
                self._method = _choice(
                    "Method", {method.value: method.value.upper() for method in Method}, chosen.method
                )
                self._accuracy = _choice("Accuracy", {one.value: one.value for one in Accuracy}, chosen.accuracy)
                self._voxels = _choice("Voxels", {one.value: one.value for one in VoxelType}, chosen.voxels)
            self._table = table_of(
                ("run", "Run"),
                ("kind", "Kind"),
                ("shots", "Valid / shots"),
                ("outcome", "Outcome"),
                ("actions", ""),
            )
            self._table.on("act", self._on_act)

    async def reload(self) -> None:
        """Read the run directories again."""
        runs = await asyncio.to_thread(self._context.runs.newest, _SHOWN)
        self._table.rows = [run_row(run) for run in runs if run.kind in (*self._kinds, None)]
        self._table.update()

    async def _on_act(self, event: Any) -> None:
        ask = {_CALIBRATE: self._calibrate, _RECONSTRUCT: self._reconstruct, _MEASURE: self._measure}
        await queue(lambda: ask[event.args["action"]](event.args["id"]))

    def _calibrate(self, run_id: str) -> list[Job]:
        return [self._context.runner.submit(calibration_job(run_id, f"{run_id}-pinhole", "pinhole"))]

    def _reconstruct(self, run_id: str) -> list[Job]:
        chosen = {
            "method": Method(self._method.value),
            "accuracy": Accuracy(self._accuracy.value),
            "voxels": VoxelType(self._voxels.value),
        }
        settings: ReconstructionSettings = self._context.services.settings.model_copy(update=chosen)
        return request_reconstruction(self._context, run_id, None, None, settings)

    def _measure(self, run_id: str) -> list[Job]:
        return request_measurement(self._context, run_id, None, None, None)


def _choice(label: str, options: dict[str, str], value: str) -> ui.select:
    select = ui.select(options, value=str(value)).classes("text-xs")
    return select.props(f'dense borderless options-dense aria-label="{label}"')


def run_row(run: RunSummary) -> dict[str, Any]:
    """One run in the table; a completed one with invalid shots is not green."""
    valid = "…" if run.shots_valid is None else run.shots_valid
    lost_shots = run.outcome == RunOutcome.COMPLETED and run.shots_valid != run.shots_recorded
    return {
        "id": run.run_id,
        "run": f"{run.run_id}: {run.cause}" if run.outcome == DAMAGED else run.run_id,
        "kind": run.kind,
        "shots": f"{valid} / {run.shots_recorded}",
        "outcome": run.outcome,
        "colour": "warning" if lost_shots else outcome_colour(run.outcome),
        "actions": [] if run.outcome == ACTIVE else _ACTIONS_OF.get(run.kind, []),
    }
