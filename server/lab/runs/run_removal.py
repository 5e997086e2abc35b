"""A run is removed: only by whoever writes its name, and never while somebody works on it."""

import shutil
from pathlib import Path
from threading import Lock
from typing import Annotated

from pydantic import Field

from daq.files.lock_file import hold_folder
from daq.files.storage import storing
from daq.frozen_model import FrozenModel
from server.lab.errors import Conflict, Unprocessable
from server.lab.jobs.job import JobState
from server.lab.jobs.job_table import JobTable
from server.lab.runs.run_store import RunStore
from server.lab.runs.unkept_runs import UnkeptRuns

REMOVED = "removed"
"""Folder of the data directory for runs whose files are being deleted; what a crash leaves there goes next time."""
_REMOVING = Lock()
"""Two who delete the same run, or empty that folder, would take it from each other."""


class RemovedRun(FrozenModel):
    """What became of a run."""

    run_id: Annotated[str, Field(description="that is gone, with its results and jobs")]
    was_reference_of: Annotated[
        tuple[str, ...], Field(description="runs that name it; they hold their own means of its images")
    ]


def remove_run(runs: RunStore, unkept: UnkeptRuns, jobs: JobTable, run_id: str, typed: str) -> RemovedRun:
    """Delete a run, its results and its jobs; what is damaged, too.

    Parameters
    ----------
    runs, unkept, jobs : RunStore, UnkeptRuns, JobTable
        All that know of it.
    run_id : str
        Which one.
    typed : str
        The same, as a person has written it.

    Raises
    ------
    NotFound
        There is no such run.
    Unprocessable
        Something else was written.
    Conflict, AlreadyHeld
        It is being recorded, or worked on.
    StorageError
        The disk refuses.
    """
    with _REMOVING:
        return _remove(runs, unkept, jobs, run_id, typed)


def _remove(runs: RunStore, unkept: UnkeptRuns, jobs: JobTable, run_id: str, typed: str) -> RemovedRun:
    run_dir = runs.directory(run_id)
    if typed != run_id:
        raise Unprocessable(f"run {run_id} is deleted by whoever writes its name: {run_id!r}, not {typed!r}")
    runs.require_closed(run_id)
    if waiting := jobs.newest(run_id, [JobState.QUEUED, JobState.RUNNING]):
        raise Conflict(f"run {run_id} is being worked on, {waiting[0].id} is {waiting[0].state}: abort its jobs first")
    referring = runs.referring_to(run_id)
    with hold_folder(run_dir):
        aside = _set_aside(run_dir)
    shutil.rmtree(aside, ignore_errors=True)  # first: what is noted now needs room on a disk that may be full
    runs.forget(run_id)
    jobs.forget(run_id)
    unkept.keep(run_id)
    return RemovedRun(run_id=run_id, was_reference_of=referring)


def _set_aside(run_dir: Path) -> Path:
    """Give it another place first: half a run is never seen."""
    folder = run_dir.parent / REMOVED
    shutil.rmtree(folder, ignore_errors=True)
    with storing(run_dir.parent):
        folder.mkdir(exist_ok=True)
        run_dir.rename(folder / run_dir.name)
    return folder
