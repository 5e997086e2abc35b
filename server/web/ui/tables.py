"""Tables of the page: runs with their outcomes, jobs with their states."""

import asyncio
import math
from collections.abc import Awaitable, Callable
from typing import Any

from nicegui import ui

from daq.errors import DaqError
from daq.run.state import RunOutcome
from daq.run_plan import RunKind
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.calibration.verdict import BELONGING, Verdict
from processing.reconstruction.choices import Accuracy, VoxelType
from processing.reconstruction.choices import ReconstructionMethod as Method
from processing.reconstruction.settings import ReconstructionSettings
from processing.runs.exposure_faults import fault_lines
from server.lab.droplets.measurement import request_measurement
from server.lab.errors import ServerError
from server.lab.jobs import Job, JobKind, JobState, calibration_job
from server.lab.reconstruction import request_reconstruction
from server.lab.runs.run_summary import ACTIVE, DAMAGED, RunSummary
from server.lab.services import Context
from server.lab.starting.run_start import choose_calibration
from server.web.ui.run_panel import outcome_colour
from server.web.ui.theme import panel

_BADGE = '<q-td :props="props"><q-badge :color="props.row.colour" :label="props.value" /></q-td>'
_ACTIONS = """<q-td :props="props" auto-width><q-btn v-for="action in props.value" :key="action" :label="action"
dense flat no-caps size="sm" color="primary" @click.stop="$parent.$emit('act', { ...props.row, action })" /></q-td>"""
_CALIBRATE, _RECONSTRUCT, _MEASURE = "Calibrate", "Reconstruct", "Measure"
_ACTIONS_OF = {RunKind.CALIBRATION: [_CALIBRATE], RunKind.SAMPLE: [_RECONSTRUCT, _MEASURE], None: []}
_SHOWN = 60
_TRUSTED = (Verdict.GOOD, Verdict.USABLE)


class RunTable:
    """Runs, newest first; a calibration run can be fitted, a sample run reconstructed as chosen, or measured."""

    def __init__(self, context: Context) -> None:
        self._context = context
        with panel("Runs", "flex-1"):
            with ui.row().classes("w-full items-center justify-between no-wrap q-mt-none"):
                ui.label("Reconstruct by").classes("text-xs opacity-70")
                chosen = context.services.settings
                self._method = _choice(
                    "Method", {method.value: method.value.upper() for method in Method}, chosen.method
                )
                self._accuracy = _choice("Accuracy", {one.value: one.value for one in Accuracy}, chosen.accuracy)
                self._voxels = _choice("Voxels", {one.value: one.value for one in VoxelType}, chosen.voxels)
            self._table = _table(
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
        self._table.rows = [run_row(run) for run in runs]
        self._table.update()

    async def _on_act(self, event: Any) -> None:
        ask = {_CALIBRATE: self._calibrate, _RECONSTRUCT: self._reconstruct, _MEASURE: self._measure}
        await _queue(lambda: ask[event.args["action"]](event.args["id"]))

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


class JobPanel:
    """Jobs, newest first; an unfinished one can be aborted, a fitted calibration chosen."""

    def __init__(self, context: Context) -> None:
        self._context = context
        with panel("Processing", "flex-1"):
            self._table = _table(("job", "Job"), ("run", "Run"), ("outcome", "State"), ("actions", ""), ("detail", ""))
            self._table.on("act", self._on_act)

    async def reload(self) -> None:
        """Read the job table again."""
        jobs = await asyncio.to_thread(self._context.jobs.newest, None, JobState, _SHOWN)
        self._table.rows = [job_row(job) for job in jobs]
        self._table.update()

    async def _on_act(self, event: Any) -> None:
        if event.args["action"] == "Abort":
            await _try(lambda: self._context.runner.abort(event.args["id"]))
        else:
            await _try(lambda: self._choose(event.args["calibration"]))

    async def _choose(self, calibration: str) -> None:
        await asyncio.to_thread(choose_calibration, self._context, calibration)
        ui.notify(f"{calibration} is the current calibration", type="positive")


def _choice(label: str, options: dict[str, str], value: str) -> ui.select:
    select = ui.select(options, value=str(value)).classes("text-xs")
    return select.props(f'dense borderless options-dense aria-label="{label}"')


async def _queue(request: Callable[[], list[Job]]) -> None:
    """Ask for jobs in a thread, and say what came of it."""

    async def ask() -> None:
        text, is_work = answer_of(await asyncio.to_thread(request))
        ui.notify(text, type="positive" if is_work else "warning")

    await _try(ask)


def answer_of(jobs: list[Job]) -> tuple[str, bool]:
    """What an operator is told of a request, and whether there is work to be done."""
    waiting = sum(job.state in (JobState.QUEUED, JobState.RUNNING) for job in jobs)
    if not jobs:
        return "nothing to do: the run has no valid shot", False
    if not waiting:
        return "nothing to do: it is done already", False
    return f"{waiting} {'job is' if waiting == 1 else 'jobs are'} queued, see Processing", True


async def _try(action: Callable[[], Awaitable[Any]]) -> None:
    try:
        await action()
    except (DaqError, ServerError) as error:
        ui.notify(str(error), type="negative")


def _table(*columns: tuple[str, str]) -> ui.table:
    described = [
        {"name": name, "label": label, "field": name, "align": "left", "classes": name} for name, label in columns
    ]
    table = (
        ui.table(columns=described, rows=[], row_key="id").classes("w-full").props("dense flat wrap-cells hide-bottom")
    )
    table.props('rows-per-page-options="[0]" :pagination="{rowsPerPage: 0}"')
    table.add_slot("body-cell-outcome", _BADGE)
    table.add_slot("body-cell-actions", _ACTIONS)
    return table


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


def job_row(job: Job) -> dict[str, Any]:
    """One job in the table, what came of it included."""
    is_calibration = job.kind is JobKind.CALIBRATION
    choices = {
        JobState.QUEUED: ["Abort"],
        JobState.RUNNING: ["Abort"],
        JobState.DONE: ["Use"] if is_calibration else [],
    }
    return {
        "id": job.id,
        "job": _name(job),
        "run": job.run_id,
        "outcome": job.state,
        "colour": "warning" if job.state is JobState.DONE and _is_doubtful(job) else outcome_colour(job.state),
        "detail": job.error or "; ".join(told for told in (_DETAIL[job.kind](job), _belonging(job)) if told),
        "actions": choices.get(job.state, []),
        "calibration": job.calibration,
    }


def _name(job: Job) -> str:
    method = str(job.settings.get("method", "")).upper()
    return {
        JobKind.CALIBRATION: "calibration",
        JobKind.CHECK: f"check of shot {job.shot}",
        JobKind.RECONSTRUCTION: f"{method} shot {job.shot}",
        JobKind.MEASUREMENT: f"droplets of shot {job.shot}",
    }[job.kind]


def _disparity(job: Job) -> str:
    """The view that disagrees most, or why the droplets do not tell; nothing before the check has ended."""
    result = job.result or {"views": {}}
    if not result["views"]:
        return ", ".join(str(result[key]) for key in ("problem", "verdict") if result.get(key))
    worst = result["moved"] or max(result["views"], key=result["views"].__getitem__)
    return f"{worst} {result['views'][worst]:.2f} px, {result['verdict']}"


def _quality(job: Job) -> str:
    """Hold-out error, verdict and reasons of the worst view of a calibration; nothing before it has ended."""
    result = job.result or {"views": {}}
    badness = {
        name: (list(Verdict).index(view["verdict"]), _holdout_px(view)) for name, view in result["views"].items()
    }
    if not badness:
        return ""
    worst = max(badness, key=badness.__getitem__)
    view = result["views"][worst]
    told = f"{worst}: hold-out {_holdout_px(view):.3f} px, {view['verdict']}"
    unchecked = [f"not checked {one['what']}" for one in result.get("not_checked", [])]
    return "; ".join([told, *view.get("reasons", []), *unchecked])


def _holdout_px(view: dict[str, Any]) -> float:
    return math.inf if view["holdout_error_px"] is None else float(view["holdout_error_px"])


def _volumes(job: Job) -> str:
    """What is wrong with the images of an exposure, and the views that could not be rectified; nothing where all is."""
    result = job.result or {}
    views = result.get("views", {})
    faults = [
        f"exposure {volume['frame']}: {line}" for volume in result.get("volumes", ()) for line in fault_lines(volume)
    ]
    slow = [f"{name} exact: {view['reason']}" for name, view in views.items() if view["reason"]]
    return "; ".join([*faults, *slow])


def _belonging(job: Job) -> str:
    """What droplets say against run and calibration, or that they say nothing; nothing where they agree."""
    asked = (job.result or {}).get(BELONGING)
    if asked is None or asked["verdict"] in _TRUSTED:
        return ""
    shots = ", ".join(str(check["shot"]) for check in asked["shots"])
    if asked["verdict"] is None and job.kind is JobKind.MEASUREMENT:
        return ""  # droplets have been fitted: their own verdict tells more
    if not asked["shots"]:
        return "not checked yet whether run and calibration belong together"
    if asked["verdict"] is None:
        return f"not checked whether run and calibration belong together (asked: shot {shots})"
    return f"droplets speak against run and calibration: {asked['verdict']} (shot {asked['shots'][0]['shot']})"


def _is_doubtful(job: Job) -> bool:
    """Whether something that is done is not to be trusted without a look: amber, not green."""
    result = job.result or {}
    verdicts = [result.get("verdict"), *(view.get("verdict") for view in _views(result).values())]
    doubted = [verdict for verdict in verdicts if verdict not in (*_TRUSTED, ShotVerdict.GOOD, ShotVerdict.EMPTY, None)]
    belonging = result.get(BELONGING, {}).get("verdict") in (Verdict.WARN, Verdict.REFUSE)
    return bool(doubted) or belonging or any(fault_lines(volume) for volume in result.get("volumes", ()))


def _views(result: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Views of a calibration or a reconstruction; those of a check are figures."""
    return {name: view for name, view in result.get("views", {}).items() if isinstance(view, dict)}


def _found(job: Job) -> str:
    """Droplets, verdict and reasons of a measurement; nothing before it has ended."""
    if not job.result:
        return ""
    return "; ".join([f"{job.result['droplets']} droplets, {job.result['verdict']}", *job.result["reasons"]])


_DETAIL = {
    JobKind.CALIBRATION: _quality,
    JobKind.CHECK: _disparity,
    JobKind.RECONSTRUCTION: _volumes,
    JobKind.MEASUREMENT: _found,
}
