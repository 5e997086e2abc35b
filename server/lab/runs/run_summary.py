"""RunSummary: one run in a list, and how it is told from its directory."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field

from daq.causes import CauseCode
from daq.files.run_directory import RunReader
from daq.frozen_model import FrozenModel
from daq.run.events import RunStatus
from daq.run.state import RunOutcome
from daq.run_plan import ImageKey, RunKind, RunPlan

ACTIVE = "active"
"""Stands in the place of the outcome while a run is being recorded."""
DAMAGED = "damaged"
"""Stands in the place of the outcome of a run that cannot be read; the cause says why."""


class RunCause(FrozenModel):
    """One reason why a run ended."""

    model_config = ConfigDict(from_attributes=True)

    code: Annotated[CauseCode, Field(description="for programs; docs/operate.md lists them")]
    text: Annotated[str, Field(description="names device, value and limit")]
    remedy: Annotated[str, Field(description="what to do")]
    at_utc: Annotated[str, Field(description="when it was noticed, ISO 8601")]


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
    causes: Annotated[
        tuple[RunCause, ...],
        Field(description="every reason, the first one first; empty while it is active, and in runs from before"),
    ] = ()
    ended_utc: Annotated[str, Field(description="when it ended, ISO 8601; empty while it is open")] = ""
    views: Annotated[tuple[str, ...], Field(description="names of the lines of sight")]
    frames_per_shot: Annotated[int, Field(description="2: exposures A and B; 1: single ones; 0: nobody knows")]
    shots_planned: Annotated[int | None, Field(description="null for imported images")]
    shots_recorded: Annotated[int, Field(description="shots on the disk")]
    shots_valid: Annotated[int | None, Field(description="null before the run has ended")]
    shots_unstored: Annotated[
        tuple[int, ...], Field(description="that were fired and never reached the disk, by number")
    ] = ()
    calibration: Annotated[str | None, Field(description="that reconstructs it, where the run names one")]


def summary_of(run: RunReader, image_keys: NDArray[np.int64]) -> RunSummary:
    """A run that is not active, with the ImageKey of every shot; ShotFileError if it cannot be read."""
    plan, outcome = run.header.plan, run.outcome
    return RunSummary(
        run_id=run.run_dir.name,
        name=plan.name if plan else run.run_dir.name,
        kind=plan.kind if plan else None,
        created_utc=run.header.created_utc,
        outcome=outcome or RunOutcome.INTERRUPTED,
        cause=run.cause,
        causes=tuple(map(RunCause.model_validate, run.causes)),
        ended_utc=run.ended_utc,
        views=tuple(run.header.views),
        frames_per_shot=run.header.frames_per_shot,
        shots_planned=plan.total_shots if plan else None,
        shots_recorded=len(image_keys),
        shots_unstored=run.unstored,
        shots_valid=int(np.count_nonzero(image_keys != ImageKey.INVALID)) if outcome else None,
        calibration=(plan.calibration if plan else None) or run.header.calibration_id,
    )


def summary_of_absent(run_id: str, status: RunStatus, plan: RunPlan) -> RunSummary:
    """The last run, whose directory was taken away."""
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


def summary_of_damaged(run_dir: Path, started: datetime, cause: str) -> RunSummary:
    """A run that cannot be read: it hides no other."""
    return RunSummary(
        run_id=run_dir.name,
        name=run_dir.name,
        kind=None,
        created_utc=started.isoformat(),
        outcome=DAMAGED,
        cause=cause,
        views=(),
        frames_per_shot=0,
        shots_planned=None,
        shots_recorded=0,
        shots_valid=None,
        calibration=None,
    )
