"""Job: one piece of work of the processing side: what was asked for, what became of it.

::

    QUEUED ──▶ RUNNING ──▶ DONE ────▶ QUEUED   (its files are gone, and it was asked for again)
      │ ▲         ├──────▶ FAILED ──▶ QUEUED   (asked for again)
      │ └─────────┤                            (the server died)
      └───────────┴──────▶ ABORTED ─▶ QUEUED   (asked for again)
"""

from collections.abc import Mapping
from datetime import UTC, datetime
from enum import StrEnum
from typing import Annotated, Any

from pydantic import Field

from daq.frozen_model import FrozenModel


class JobKind(StrEnum):
    """What a job does."""

    RECONSTRUCTION = "reconstruction"
    MEASUREMENT = "measurement"
    CALIBRATION = "calibration"
    CHECK = "check"


class JobState(StrEnum):
    """Where a job stands."""

    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    ABORTED = "aborted"


TRANSITIONS: Mapping[JobState, frozenset[JobState]] = {
    JobState.QUEUED: frozenset({JobState.RUNNING, JobState.ABORTED}),
    JobState.RUNNING: frozenset({JobState.DONE, JobState.FAILED, JobState.ABORTED, JobState.QUEUED}),
    JobState.DONE: frozenset({JobState.QUEUED}),
    JobState.FAILED: frozenset({JobState.QUEUED}),
    JobState.ABORTED: frozenset({JobState.QUEUED}),
}
"""State -> states that may follow."""
UNSUCCESSFUL = (JobState.FAILED, JobState.ABORTED)
ENDED = (JobState.DONE, *UNSUCCESSFUL)
"""States of jobs that do not run or wait."""


def now_utc() -> str:
    """Time of day, ISO 8601."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


class Job(FrozenModel):
    """One piece of work of the processing side, by itself a complete account of it."""

    id: Annotated[str, Field(description="made of run, results and shot: the same work has the same id")]
    kind: Annotated[JobKind, Field(description="what is done")]
    run_id: Annotated[str, Field(description="run that it works on")]
    shot: Annotated[int | None, Field(description="index of the shot; null for a calibration")] = None
    calibration: Annotated[str, Field(description="id of the calibration that is used, or made")]
    results_id: Annotated[str | None, Field(description="directory of the results in the run; null if there are none")]
    settings: Annotated[dict[str, Any], Field(description="what the work function is told")]
    state: Annotated[JobState, Field(description="where it stands")] = JobState.QUEUED
    result: Annotated[dict[str, Any] | None, Field(description="what it said when done")] = None
    error: Annotated[str | None, Field(description="why it failed")] = None
    created_utc: Annotated[str, Field(description="when it was asked for, ISO 8601")] = Field(default_factory=now_utc)
    changed_utc: Annotated[str, Field(description="when its state last changed, ISO 8601")] = Field(
        default_factory=now_utc
    )


def shot_job(
    kind: JobKind, run_id: str, shot: int, calibration: str, results_id: str, settings: Mapping[str, Any]
) -> Job:
    """Job for one shot; ``results_id`` stands for settings and calibration, and names the directory of the results."""
    return Job(
        id=f"{run_id}.{results_id}.{shot:05d}",
        kind=kind,
        run_id=run_id,
        shot=shot,
        calibration=calibration,
        results_id=results_id,
        settings=dict(settings),
    )


def reconstruction_job(run_id: str, shot: int, calibration: str, results_id: str, settings: Mapping[str, Any]) -> Job:
    """Job that makes the volumes of a shot."""
    return shot_job(JobKind.RECONSTRUCTION, run_id, shot, calibration, results_id, settings)


def finished(job: Job) -> Job:
    """Such a job whose files are there."""
    return job.model_copy(update={"state": JobState.DONE})


def calibration_job(run_id: str, calibration: str, model: str) -> Job:
    """Job that makes a calibration from a calibration run."""
    return Job(
        id=f"{run_id}.{calibration}",
        kind=JobKind.CALIBRATION,
        run_id=run_id,
        calibration=calibration,
        results_id=None,
        settings={"model": model},
    )


def check_job(run_id: str, shot: int, calibration: str, content: str = "") -> Job:
    """Job that measures how well a calibration fits a shot; another content of the same name is checked anew."""
    named = f"{calibration}-{content}" if content else calibration
    return Job(
        id=f"{run_id}.check-{named}.{shot:05d}",
        kind=JobKind.CHECK,
        run_id=run_id,
        shot=shot,
        calibration=calibration,
        results_id=None,
        settings={"content": content},
    )
