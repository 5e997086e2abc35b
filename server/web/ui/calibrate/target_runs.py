"""TargetRuns: runs that show the target, and a calibration of a chosen kind from each."""

import asyncio
from functools import partial
from typing import Any

from nicegui import ui

from daq.run_plan import RunKind
from server.lab.jobs.job import Job, JobKind, JobState
from server.lab.runs.run_summary import ACTIVE, DAMAGED, PACKED, RunSummary
from server.lab.services import Context
from server.lab.starting.calibrating import request_calibration
from server.web.ui.asking import queue
from server.web.ui.run.run_panel import outcome_colour
from server.web.ui.table import table_of
from server.web.ui.theme import panel
from server.web.ui.visiting import visitor

_JOBS_LOOKED_AT = 1000
_SHOWN = 30
_MODELS = {
    "pinhole": "pinhole: what most lenses are",
    "pinhole_tilted": "pinhole with a tilted sensor (Scheimpflug)",
    "polynomial": "polynomial: through windows, without a model of them",
    "auto": "auto: the one that predicts best",
}
_CALIBRATE = "Calibrate"
UNDER_WAY = (JobState.QUEUED, JobState.RUNNING)


class TargetRuns:
    """Built once per page."""

    def __init__(self, context: Context) -> None:
        self._context = context
        with panel("Calibration runs"):
            self._model = ui.select(_MODELS, value="pinhole", label="Kind of camera").classes("w-full")
            self._model.props("dense outlined options-dense")
            self._nothing = ui.label(
                "No run shows the target yet: put it into the volume, and start a run of kind calibration, page Run."
            ).classes("text-sm")
            self._table = table_of(
                ("run", "Run"), ("shots", "Valid / shots"), ("outcome", "State"), ("actions", ""), ("detail", "")
            )
            self._table.on("act", self._on_act)

    async def reload(self) -> None:
        """Read the runs again, and what is being made of them."""
        runs, jobs = await asyncio.gather(
            asyncio.to_thread(self._context.runs.newest_that, lambda run: run.kind is RunKind.CALIBRATION, _SHOWN),
            asyncio.to_thread(self._context.jobs.newest, None, JobState, _JOBS_LOOKED_AT, [JobKind.CALIBRATION]),
        )
        newest_job = {job.run_id: job for job in reversed(jobs)}
        self._table.rows = [target_row(run, newest_job.get(run.run_id)) for run in runs]
        self._table.set_visibility(bool(runs))
        self._nothing.set_visibility(not runs)
        self._table.update()

    async def _on_act(self, event: Any) -> None:
        ask = partial(request_calibration, self._context, event.args["id"], self._model.value, visitor())
        await queue(lambda: [ask()])


def target_row(run: RunSummary, job: Job | None) -> dict[str, Any]:
    """One run; the state of its newest calibration, where there is one."""
    state = job.state if job else run.outcome
    valid = run.shots_valid if run.shots_valid is not None else "…" if run.outcome == ACTIVE else "?"
    is_under_way = job is not None and job.state in UNDER_WAY
    return {
        "id": run.run_id,
        "run": run.run_id,
        "shots": f"{valid} / {run.shots_recorded}",
        "outcome": f"fit {state}" if job else state,
        "colour": outcome_colour(state),
        "actions": [_CALIBRATE] if run.outcome not in (ACTIVE, DAMAGED, PACKED) and not is_under_way else [],
        "detail": _detail(job) or told_of(run),
    }


def told_of(run: RunSummary) -> str:
    """Why nothing can be made of a run, and what to do; nothing where something can."""
    return f"{run.cause}: {run.remedy}" if run.outcome in (DAMAGED, PACKED) else ""


def _detail(job: Job | None) -> str:
    if job is None:
        return ""
    return job.error or f"{job.settings.get('model', '')}: {job.calibration}"
