"""LookedAt: what the page of results shows, and what there is to be chosen. Pure but for reading lists."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

from daq.run_plan import RunKind
from processing.reconstruction.choices import ReconstructionMethod
from server.lab.errors import NotFound
from server.lab.jobs.job import JobKind, JobState
from server.lab.results import ResultSet, result_sets
from server.lab.runs.run_summary import ACTIVE, DAMAGED, PACKED, RunSummary
from server.lab.services import Context

_RUNS = 300


@dataclass(frozen=True)
class LookedAt:
    """One shot of a result set.

    Parameters
    ----------
    run_id, results_id : str
        Where it lies.
    shot : int
        Which one.
    """

    run_id: str
    results_id: str
    shot: int

    @property
    def address(self) -> str:
        """Of the page that shows it."""
        return f"/results/{self.run_id}/{self.results_id}/{self.shot}"


def runs_with_results(context: Context) -> list[RunSummary]:
    """Runs of which something came, newest first by their own time."""
    return context.runs.with_results(_RUNS)


def sets_of(context: Context, run_id: str) -> list[ResultSet]:
    """Result sets of a run in which there is something, newest first."""
    return [one for one in result_sets(context.runs.directory(run_id)) if one.volumes or one.droplets]


def newest(context: Context) -> LookedAt | None:
    """What was made last; where the table of jobs does not know, of the newest run that has results."""
    for job in context.jobs.newest(None, [JobState.DONE], 1, [JobKind.RECONSTRUCTION]):
        if job.results_id and job.shot is not None and _is_there(context, job.run_id, job.results_id, job.shot):
            return LookedAt(job.run_id, job.results_id, job.shot)
    for run in runs_with_results(context):
        if one := first_of(sets_of(context, run.run_id)):
            return LookedAt(run.run_id, one.id, shots_of(one)[-1])
    return None


def first_of(sets: Sequence[ResultSet]) -> ResultSet | None:
    """What is shown of a run where nobody has chosen: the newest volumes, or else the newest droplets."""
    return next((one for one in sets if one.volumes), sets[0] if sets else None)


def shots_of(one: ResultSet) -> list[int]:
    """Shots of which there is something."""
    return sorted({volume.shot for volume in one.volumes} | {droplets.shot for droplets in one.droplets})


def nothing_text(run: RunSummary) -> str:
    """Why there are no results of a run, and how there would be some."""
    if run.outcome in (DAMAGED, PACKED):
        return f"Run {run.run_id} cannot be read: {run.cause}. Open the run for what to do."
    if run.outcome == ACTIVE:
        return f"Run {run.run_id} is being recorded, and nothing has been made of it yet."
    if run.kind not in (RunKind.SAMPLE, None):
        return f"Run {run.run_id} is a {run.kind} run: volumes and droplets are made of sample runs."
    return f"Nothing has been made of run {run.run_id} yet: reconstruct or measure it below."


def exposures_of(one: ResultSet, shot: int) -> dict[str, str]:
    """Names of the volumes of a shot, by exposure."""
    return {volume.frame: volume.name for volume in one.volumes if volume.shot == shot}


def set_with_droplets(sets: Sequence[ResultSet], shown: ResultSet, shot: int) -> ResultSet | None:
    """Where the droplets of a shot are: in what is shown, or measured last."""
    return next((one for one in (shown, *sets) if any(each.shot == shot for each in one.droplets)), None)


def method_of(one: ResultSet) -> ReconstructionMethod | None:
    """What made the volumes; None of droplets, and where nobody can tell."""
    name = _settings_of(one).get("method") or one.id.partition("-")[0]
    return next((method for method in ReconstructionMethod if method.value == name), None)


def label_of(one: ResultSet) -> str:
    """A result set in a choice: by which method, of how many shots, with which calibration."""
    method, shots = method_of(one), len(shots_of(one))
    accuracy = _settings_of(one).get("accuracy", "")
    what = "droplets" if not one.volumes else " ".join((method.value.upper() if method else "volumes", str(accuracy)))
    calibration = one.provenance.get("calibration_file") or ""
    named = f" · {str(calibration).removesuffix('.json')}" if calibration else ""
    return f"{what.strip()} · {shots} {'shot' if shots == 1 else 'shots'}{named} · {one.id}"


def _settings_of(one: ResultSet) -> dict[str, object]:
    written = one.provenance.get("settings", {})
    try:
        settings = json.loads(written) if isinstance(written, str) else written
    except ValueError:
        return {}
    return settings if isinstance(settings, dict) else {}


def _is_there(context: Context, run_id: str, results_id: str, shot: int) -> bool:
    try:
        sets = sets_of(context, run_id)
    except NotFound:
        return False
    return any(one.id == results_id and shot in shots_of(one) for one in sets)
