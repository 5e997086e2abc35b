"""Jobs whose calibration was replaced under its name: what they say is of the one before."""

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

from server.lab.calibrations import CalibrationStore
from server.lab.jobs.job import Job, JobKind
from server.lab.results import result_calibration


def replaced_since(calibrations: CalibrationStore, data_dir: Path, jobs: Sequence[Job]) -> set[str]:
    """Ids of jobs of which the file that has the name of their calibration now is another one."""
    now = {name: calibrations.content_id(name) for name in {job.calibration for job in jobs}}
    of_results = cache(lambda run_id, name: result_calibration(data_dir / run_id, name))
    made_by = {job.id: _content_of(job, of_results) for job in jobs}
    return {job.id for job in jobs if now[job.calibration] and made_by[job.id] not in (None, "", now[job.calibration])}


def _content_of(job: Job, of_results: Callable[[str, str], str | None]) -> str | None:
    """Hash of the calibration that a job has made or used; None or empty where nobody knows it, or not yet."""
    if job.kind is JobKind.CALIBRATION:
        return (job.result or {}).get("calibration")
    if job.kind is JobKind.CHECK or job.results_id is None:
        return job.settings.get("content")
    return of_results(job.run_id, job.results_id)
