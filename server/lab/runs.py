"""RunStore: what lies in the run directories, for lists and pages. The directories are the truth; nothing is copied."""

import re
from collections.abc import Callable
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from daq.errors import ShotFileError
from daq.files.run_directory import RunReader, list_runs
from daq.files.run_file import RUN_FILE
from daq.frozen_model import FrozenModel
from daq.names import is_identifier
from daq.run.events import RunStatus
from daq.run.state import RunOutcome
from daq.run_plan import ImageKey, RunKind, RunPlan
from server.lab.errors import NotFound

ACTIVE = "active"
"""Stands in the place of the outcome while a run is being recorded."""
DAMAGED = "damaged"
"""Stands in the place of the outcome of a run that cannot be read; the cause says why."""
_TIME_IN_ID = re.compile(r"(\d{8}T\d{6})-")


class RunSummary(FrozenModel):
    """One run in a list."""

    run_id: Annotated[str, Field(description="name of the run directory")]
    name: Annotated[str, Field(description="what the operator calls it")]
    kind: Annotated[RunKind | None, Field(description="what was prepared; null for imported images")]
    created_utc: Annotated[str, Field(description="when it was started, ISO 8601")]
    outcome: Annotated[
        str, Field(description="completed, stopped, aborted, failed, interrupted; active; damaged: it cannot be read")
    ]
    cause: Annotated[str, Field(description="why it ended, or why it cannot be read; empty if it was completed")]
    views: Annotated[tuple[str, ...], Field(description="names of the lines of sight")]
    frames_per_shot: Annotated[int, Field(description="2: exposures A and B; 1: single ones; 0: nobody knows")]
    shots_planned: Annotated[int | None, Field(description="null for imported images")]
    shots_recorded: Annotated[int, Field(description="shots on the disk")]
    shots_valid: Annotated[int | None, Field(description="null before the run has ended")]
    calibration: Annotated[str | None, Field(description="that reconstructs it, where the run names one")]


class RunStore:
    """Run directories in one folder.

    Parameters
    ----------
    data_dir : Path
        Folder of the run directories.
    status : Callable[[], RunStatus]
        Asked which run is active: any other one without an outcome was interrupted.
    """

    def __init__(self, data_dir: Path, status: Callable[[], RunStatus]) -> None:
        self._data_dir = data_dir
        self._status = status

    def directory(self, run_id: str) -> Path:
        """Directory of a run; NotFound if there is none."""
        path = self._data_dir / run_id
        if not is_identifier(run_id) or not (path / RUN_FILE).is_file():
            raise NotFound(f"there is no run {run_id!r}")
        return path

    def reader(self, run_id: str) -> RunReader:
        """Reader of a run; NotFound if there is none."""
        return RunReader(self.directory(run_id))

    def summary(self, run_id: str) -> RunSummary:
        """What a run is and how it went, from the moment it was accepted; NotFound if there is none."""
        status = self._status()
        if status.run_id == run_id and status.plan and not (self._data_dir / run_id / RUN_FILE).is_file():
            return _summary_of_beginning(run_id, status, status.plan)
        return self._summary_of(self.directory(run_id))

    def require_sound(self, summary: RunSummary) -> None:
        """Raise ShotFileError if a run is damaged."""
        if summary.outcome == DAMAGED:
            raise ShotFileError(summary.cause)

    def newest(self, limit: int = 100) -> list[RunSummary]:
        """Runs, newest first by their own time, whatever has been done to their directories since.

        Ids tell it to the second, so that a long list need not be read; headers tell two of the same second apart.
        """
        directories = sorted(list_runs(self._data_dir), key=_started, reverse=True)[:limit]
        directories.sort(key=lambda path: (_started(path), _created(path, _changed_ns(path / RUN_FILE))), reverse=True)
        return [self._summary_of(path) for path in directories]

    def _summary_of(self, run_dir: Path) -> RunSummary:
        try:
            read = _read_summary(run_dir, _changed_ns(run_dir / RUN_FILE), _changed_ns(run_dir / "shots"))
        except ShotFileError as error:
            return _summary_of_damaged(run_dir, str(error))
        status = self._status()
        if not (status.active and status.run_id == run_dir.name):
            return read
        return read.model_copy(update={"outcome": ACTIVE})


def _summary_of_beginning(run_id: str, status: RunStatus, plan: RunPlan) -> RunSummary:
    """A run that was accepted and has no directory yet, or failed before it could have one."""
    return RunSummary(
        run_id=run_id,
        name=plan.name,
        kind=plan.kind,
        created_utc=datetime.now(UTC).isoformat(),
        outcome=ACTIVE if status.active else status.outcome or RunOutcome.FAILED,
        cause=status.message,
        views=tuple(plan.pulse.current_a),
        frames_per_shot=2,
        shots_planned=plan.total_shots,
        shots_recorded=0,
        shots_valid=None,
        calibration=plan.calibration,
    )


def _summary_of_damaged(run_dir: Path, cause: str) -> RunSummary:
    """A run that cannot be read: it hides no other."""
    return RunSummary(
        run_id=run_dir.name,
        name=run_dir.name,
        kind=None,
        created_utc=_started(run_dir).isoformat(),
        outcome=DAMAGED,
        cause=cause,
        views=(),
        frames_per_shot=0,
        shots_planned=None,
        shots_recorded=0,
        shots_valid=None,
        calibration=None,
    )


def _started(run_dir: Path) -> datetime:
    """When a run was started. Its id says so, as its header does; imported runs have no time in their ids."""
    if written := _TIME_IN_ID.match(run_dir.name):
        try:
            return datetime.strptime(written[1], "%Y%m%dT%H%M%S").replace(tzinfo=UTC)
        except ValueError:
            pass  # digits, but no time
    return _created(run_dir, _changed_ns(run_dir / RUN_FILE))


@lru_cache(maxsize=4096)
def _created(run_dir: Path, changed_ns: int) -> datetime:
    """What the header says; if nobody can read it, when its file was changed."""
    try:
        created = datetime.fromisoformat(RunReader(run_dir).header.created_utc)
    except (ShotFileError, ValueError):
        return datetime.fromtimestamp(changed_ns / 1e9, UTC)
    return created if created.tzinfo else created.replace(tzinfo=UTC)


def _changed_ns(path: Path) -> int:
    """When a file or folder was changed; 0 if it is gone."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


@lru_cache(maxsize=512)
def _read_summary(run_dir: Path, _run_mtime_ns: int, _shots_mtime_ns: int) -> RunSummary:
    """Read a run once per change: a run that has ended is read once."""
    with RunReader(run_dir) as run:
        plan, outcome = run.header.plan, run.outcome
        return RunSummary(
            run_id=run_dir.name,
            name=plan.name if plan else run_dir.name,
            kind=plan.kind if plan else None,
            created_utc=run.header.created_utc,
            outcome=outcome or RunOutcome.INTERRUPTED,
            cause=run.cause,
            views=tuple(run.header.views),
            frames_per_shot=run.header.frames_per_shot,
            shots_planned=plan.total_shots if plan else None,
            shots_recorded=run.shot_count,
            shots_valid=int(np.count_nonzero(run.image_keys() != ImageKey.INVALID)) if outcome else None,
            calibration=(plan.calibration if plan else None) or run.header.calibration_id,
        )
