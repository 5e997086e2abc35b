"""RunSummary: one run in a list, and how it is told from its directory."""

import shlex
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field

from daq.causes import CauseCode
from daq.errors import ShotFileError
from daq.files.header import RunClosing
from daq.files.run_directory import RunReader
from daq.files.run_file import read_shot_count
from daq.frozen_model import FrozenModel
from daq.recipe import Recipe
from daq.run.events import RunStatus
from daq.run.state import RunOutcome
from daq.run_notes import RunNotes
from daq.run_plan import ImageKey, RunKind, RunPlan

ACTIVE = "active"
"""Stands in the place of the outcome while a run is being recorded."""
DAMAGED = "damaged"
"""Stands in the place of the outcome of a run that cannot be read; the cause says why."""
PACKED = "packed"
"""Stands in the place of the outcome of a run whose shots lie in its ``run.h5``, where nobody here reads them."""


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
        str, Field(description="completed, stopped, aborted, failed, interrupted; active; damaged or packed: see cause")
    ]
    cause: Annotated[str, Field(description="why it ended, or why it cannot be read; empty if it was completed")]
    causes: Annotated[
        tuple[RunCause, ...],
        Field(description="every reason, the first one first; empty while it is active, and in runs from before"),
    ] = ()
    remedy: Annotated[str, Field(description="what to do about the cause; empty where nothing is known")] = ""
    ended_utc: Annotated[str, Field(description="when it ended, ISO 8601; empty while it is open")] = ""
    views: Annotated[tuple[str, ...], Field(description="names of the lines of sight")]
    frames_per_shot: Annotated[int, Field(description="2: exposures A and B; 1: single ones; 0: nobody knows")]
    shots_planned: Annotated[int | None, Field(description="null for imported images")]
    shots_recorded: Annotated[int, Field(description="shots on the disk")]
    shots_valid: Annotated[int | None, Field(description="null while it is active, and where nobody can tell")]
    shots_unstored: Annotated[
        tuple[int, ...], Field(description="that were fired and never reached the disk, by number")
    ] = ()
    calibration: Annotated[str | None, Field(description="that reconstructs it, where the run names one")]
    references: Annotated[tuple[str, ...], Field(description="its dark and background runs")] = ()
    recipes: Annotated[
        tuple[Recipe, ...] | None, Field(description="what is made of its shots by itself; null: the run does not say")
    ] = None
    notes: Annotated[RunNotes, Field(description="conditions that no device knows, as they stand now")] = RunNotes()
    notes_changed_by: Annotated[str, Field(description="who wrote them after the run; empty: as recorded")] = ""
    notes_changed_utc: Annotated[str, Field(description="when, ISO 8601; empty: as recorded")] = ""
    notes_flaw: Annotated[str, Field(description="why later notes cannot be read: these are as recorded")] = ""


def summary_of(run: RunReader, image_keys: NDArray[np.int64]) -> RunSummary:
    """A run that is not active, with the ImageKey of every shot; ShotFileError if it cannot be read."""
    plan, closing = run.header.plan, run.closing or RunClosing(RunOutcome.INTERRUPTED, "", "")
    causes = tuple(map(RunCause.model_validate, closing.causes))
    return RunSummary(
        run_id=run.run_dir.name,
        name=plan.name if plan else run.run_dir.name,
        kind=plan.kind if plan else None,
        created_utc=run.header.created_utc,
        outcome=closing.outcome,
        cause=closing.cause,
        causes=causes,
        remedy=causes[0].remedy if causes else "",
        ended_utc=closing.ended_utc,
        views=tuple(run.header.views),
        frames_per_shot=run.header.frames_per_shot,
        shots_planned=plan.total_shots if plan else None,
        shots_recorded=len(image_keys),
        shots_unstored=closing.unstored,
        shots_valid=int(np.count_nonzero(image_keys != ImageKey.INVALID)),
        calibration=(plan.calibration if plan else None) or run.header.calibration_id,
        references=plan.references if plan else (),
        recipes=plan.recipes if plan else None,
        **_notes_of(run),
    )


def _notes_of(run: RunReader) -> dict[str, Any]:
    """As they stand now; a file of later notes that is damaged hides no run."""
    try:
        changes = run.notes_changes
    except ShotFileError as error:
        return {"notes": run.header.notes, "notes_flaw": str(error)}
    if not changes:
        return {"notes": run.header.notes}
    last = changes[-1]
    return {"notes": last.notes, "notes_changed_by": last.who, "notes_changed_utc": last.at_utc}


def summary_of_packed(run: RunReader) -> RunSummary:
    """A run whose shots lie in its ``run.h5``; ShotFileError if that cannot be read."""
    told = {
        "outcome": PACKED,
        "cause": f"it ended {run.outcome or RunOutcome.INTERRUPTED}, and was packed: its shots lie in run.h5",
        "remedy": "copy its folder shots back to look at it here; run.h5 can be read by any HDF5 reader",
        "shots_recorded": read_shot_count(run.run_dir),
        "shots_valid": None,
    }
    return summary_of(run, np.empty(0, np.int64)).model_copy(update=told)


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
        references=plan.references,
        recipes=plan.recipes,
        notes=plan.notes,
    )


def summary_of_misnamed(run_dir: Path, started: datetime, cause: str) -> RunSummary:
    """A run whose folder has a name by which nobody can ask for it."""
    remedy = f"rename the folder {shlex.quote(str(run_dir))}"
    return summary_of_damaged(run_dir, started, cause).model_copy(update={"remedy": remedy})


def summary_of_damaged(run_dir: Path, started: datetime, cause: str) -> RunSummary:
    """A run that cannot be read: it hides no other."""
    return RunSummary(
        run_id=run_dir.name,
        name=run_dir.name,
        kind=None,
        created_utc=started.isoformat(),
        outcome=DAMAGED,
        cause=cause,
        remedy="tomoshadow verify {0}, then tomoshadow repair {0}".format(shlex.quote(str(run_dir))),
        views=(),
        frames_per_shot=0,
        shots_planned=None,
        shots_recorded=0,
        shots_valid=None,
        calibration=None,
    )
