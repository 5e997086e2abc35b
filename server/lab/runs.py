"""RunStore: what lies in the run directories, for lists and pages. The directories are the truth; nothing is copied."""

from collections.abc import Callable
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from daq.files.run_directory import RunReader, list_runs
from daq.frozen_model import FrozenModel
from daq.run.events import RunStatus
from daq.run.state import RunOutcome
from daq.run_plan import ImageKey, RunKind, RunPlan
from server.lab.errors import NotFound

ACTIVE = "active"
"""Stands in the place of the outcome while a run is being recorded."""


class RunSummary(FrozenModel):
    """One run in a list."""

    run_id: str
    name: str
    kind: RunKind | None
    created_utc: str
    outcome: str
    cause: str
    views: tuple[str, ...]
    frames_per_shot: int
    shots_planned: int | None
    shots_recorded: int
    shots_valid: Annotated[int | None, Field(description="null before the run has ended")]
    calibration: str | None


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
        if not (path / "run.h5").is_file():
            raise NotFound(f"there is no run {run_id!r}")
        return path

    def reader(self, run_id: str) -> RunReader:
        """Reader of a run; NotFound if there is none."""
        return RunReader(self.directory(run_id))

    def summary(self, run_id: str) -> RunSummary:
        """What a run is and how it went, from the moment it was accepted; NotFound if there is none."""
        status = self._status()
        if status.run_id == run_id and status.plan and not (self._data_dir / run_id / "run.h5").is_file():
            return _summary_of_beginning(run_id, status, status.plan)
        return self._summary_of(self.directory(run_id))

    def newest(self, limit: int = 100) -> list[RunSummary]:
        """Runs, newest first."""
        directories = sorted(list_runs(self._data_dir), key=lambda path: path.stat().st_ctime_ns, reverse=True)
        return [self._summary_of(path) for path in directories[:limit]]

    def _summary_of(self, run_dir: Path) -> RunSummary:
        shots = run_dir / "shots"
        read = _read_summary(run_dir, (run_dir / "run.h5").stat().st_mtime_ns, shots.stat().st_mtime_ns)
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
