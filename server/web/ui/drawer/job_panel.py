"""JobPanel: jobs with their states and what came of them; one that has not ended can be aborted."""

import asyncio
import math
from typing import Any

from nicegui import ui

from daq.counted import counted
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.calibration.verdict import BELONGING, Verdict
from processing.runs.exposure_faults import fault_lines
from server.lab.jobs.job import Job, JobKind, JobState
from server.lab.jobs.job_table import JobTable
from server.lab.jobs.replaced_calibrations import replaced_since
from server.lab.services import Context
from server.lab.starting.calibrating import use_calibration
from server.lab.volume_doubts import TRUSTED, belonging_told
from server.web.ui.asking import try_to
from server.web.ui.run.run_panel import outcome_colour
from server.web.ui.table import table_of
from server.web.ui.theme import panel
from server.web.ui.visiting import visitor

_SHOWN = 60


class JobPanel:
    """Jobs, newest first; an unfinished one can be aborted, a fitted calibration chosen."""

    def __init__(self, context: Context) -> None:
        self._context = context
        with panel("Processing", "flex-1"):
            self._table = table_of(
                ("job", "Job"), ("run", "Run"), ("outcome", "State"), ("actions", ""), ("detail", "")
            )
            self._table.on("act", self._on_act)

    async def reload(self) -> None:
        """Read the job table again."""
        self._table.rows = await asyncio.to_thread(self._rows)
        self._table.update()

    def _rows(self) -> list[dict[str, Any]]:
        """Of the disk: whose calibrations were replaced since."""
        jobs, current = listed_jobs(self._context.jobs), self._context.calibrations.current
        replaced = replaced_since(self._context.calibrations, self._context.services.data_dir, jobs)
        return [job_row(job, current, job.id in replaced) for job in jobs]

    def filter(self, words: str) -> None:
        """Show those of the newest jobs that have these words in a cell; all of them for none."""
        self._table.set_filter(words)

    async def _on_act(self, event: Any) -> None:
        if event.args["action"] == "Abort":
            await try_to(lambda: self._context.runner.abort(event.args["id"]))
        else:
            await try_to(lambda: self._choose(event.args["calibration"]))

    async def _choose(self, calibration: str) -> None:
        await asyncio.to_thread(use_calibration, self._context, visitor(), calibration)
        ui.notify(f"{calibration} is the current calibration", type="positive")


def listed_jobs(jobs: JobTable) -> list[Job]:
    """What is being worked on, and the newest others: a long queue hides no work."""
    others = [state for state in JobState if state is not JobState.RUNNING]
    return [*jobs.oldest(JobState.RUNNING), *jobs.newest(None, others, _SHOWN)]


def job_row(job: Job, current: str | None = None, replaced: bool = False) -> dict[str, Any]:
    """One job in the table, what came of it included; the current calibration is used already.

    Of a calibration that was replaced since, there is nothing any more that could be used.
    """
    can_be_used = job.kind is JobKind.CALIBRATION and job.calibration != current and not replaced
    said = job.error or "; ".join(told for told in (_DETAIL[job.kind](job), _belonging(job)) if told)
    another = f"calibration {job.calibration} was replaced since: this is of the one that had its name before"
    choices = {
        JobState.QUEUED: ["Abort"],
        JobState.RUNNING: ["Abort"],
        JobState.DONE: ["Use"] if can_be_used else [],
    }
    return {
        "id": job.id,
        "job": _name(job),
        "run": job.run_id,
        "outcome": job.state,
        "colour": "warning" if job.state is JobState.DONE and _is_doubtful(job) else outcome_colour(job.state),
        "detail": "; ".join(told for told in (said, another if replaced else "") if told),
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
    result = job.result or {}
    badness = {
        name: (list(Verdict).index(view["verdict"]), _holdout_px(view))
        for name, view in result.get("views", {}).items()
    }
    if not badness:
        return ""
    worst = max(badness, key=badness.__getitem__)
    view = result["views"][worst]
    told = f"{worst}: hold-out {_holdout_px(view):.3f} px, {view['verdict']}"
    return "; ".join([told, *view.get("reasons", []), *_unchecked(len(result.get("not_checked", [])))])


def _unchecked(things: int) -> list[str]:
    """How many there are; the page Calibrate has their sentences, which are long."""
    return [f"not checked: {counted(things, 'thing')}, see Calibrate"] if things else []


def _holdout_px(view: dict[str, Any]) -> float:
    return math.inf if view["holdout_error_px"] is None else float(view["holdout_error_px"])


def _volumes(job: Job) -> str:
    """What is wrong with images or voxels, and the views that could not be rectified; nothing where all is."""
    result = job.result or {}
    views = result.get("views", {})
    faults = [
        f"exposure {volume['frame']}: {line}" for volume in result.get("volumes", ()) for line in fault_lines(volume)
    ]
    slow = [f"{name} exact: {view['reason']}" for name, view in views.items() if view["reason"]]
    return "; ".join(filter(None, [*faults, result.get("coarse"), *slow]))


def _belonging(job: Job) -> str:
    """What droplets say against run and calibration, or that they say nothing; nothing where they agree."""
    asked = (job.result or {}).get(BELONGING)
    if asked is not None and asked["verdict"] is None and job.kind is JobKind.MEASUREMENT:
        return ""  # droplets have been fitted: their own verdict tells more
    return belonging_told(asked)


def _is_doubtful(job: Job) -> bool:
    """Whether something that is done is not to be trusted without a look: amber, not green."""
    result = job.result or {}
    parts = [result, result.get("velocity") or {}, *_views(result).values()]
    verdicts = [part.get("verdict") for part in parts]
    doubted = [verdict for verdict in verdicts if verdict not in (*TRUSTED, ShotVerdict.GOOD, ShotVerdict.EMPTY, None)]
    belonging = result.get(BELONGING, {}).get("verdict") in (Verdict.WARN, Verdict.REFUSE)
    return bool(doubted) or belonging or any(fault_lines(volume) for volume in result.get("volumes", ()))


def _views(result: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Views of a calibration or a reconstruction; those of a check are figures."""
    return {name: view for name, view in result.get("views", {}).items() if isinstance(view, dict)}


def _found(job: Job) -> str:
    """Droplets, verdict and reasons of a measurement, and of its velocities; nothing before it has ended."""
    if not job.result:
        return ""
    found = f"{counted(job.result['droplets'], 'droplet')}, {job.result['verdict']}"
    return "; ".join([found, *job.result["reasons"], *_flown(job.result.get("velocity"))])


def _flown(velocity: dict[str, Any] | None) -> list[str]:
    """Verdict and reasons of velocities that are not good; nothing where a shot has none."""
    if velocity is None or velocity["verdict"] == ShotVerdict.GOOD:
        return []
    return [f"velocities {velocity['verdict']}", *velocity["reasons"]]


_DETAIL = {
    JobKind.CALIBRATION: _quality,
    JobKind.CHECK: _disparity,
    JobKind.RECONSTRUCTION: _volumes,
    JobKind.MEASUREMENT: _found,
}
