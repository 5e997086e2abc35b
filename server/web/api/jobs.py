"""/api/jobs: reconstructions, measurements, checks and calibrations, waiting, running and done."""

from collections.abc import Callable
from typing import Annotated

from fastapi import APIRouter, Query
from pydantic import Field

from daq.counted import counted
from daq.frozen_model import FrozenModel
from daq.names import Identifier
from processing.reconstruction.settings import ReconstructionSettings
from processing.runs.droplets.measure_settings import MeasureSettings
from server.lab.desk.once import described
from server.lab.desk.visitor import Visitor
from server.lab.droplets.measurement import request_measurement
from server.lab.jobs.job import Job, JobKind, JobState
from server.lab.reconstruction import request_reconstruction
from server.lab.services import Context
from server.lab.starting.command import tell_deed
from server.web.api.parameters import ContextOf, IdempotencyKey, JobId, Who
from server.web.problems import responses

router = APIRouter(prefix="/api/jobs", tags=["jobs"])


class ReconstructionRequest(FrozenModel):
    """Reconstruct shots of a run."""

    run_id: Annotated[Identifier, Field(description="a run whose images show a spray")]
    shots: Annotated[
        Annotated[tuple[Annotated[int, Field(ge=0)], ...], Field(min_length=1)] | None,
        Field(description="indices; null: all valid shots"),
    ] = None
    calibration: Annotated[Identifier | None, Field(description="null: the run's own, or the current one")] = None
    settings: Annotated[ReconstructionSettings, Field(description="how; default: by MLOS, what all views see")] = (
        ReconstructionSettings()
    )


class MeasurementRequest(FrozenModel):
    """Measure the droplets in shots of a run."""

    run_id: Annotated[Identifier, Field(description="a run whose images show droplets")]
    shots: Annotated[
        Annotated[tuple[Annotated[int, Field(ge=0)], ...], Field(min_length=1)] | None,
        Field(description="indices; null: all valid shots"),
    ] = None
    calibration: Annotated[Identifier | None, Field(description="null: the run's own, or the current one")] = None
    settings: Annotated[MeasureSettings | None, Field(description="how; null: as the run is recorded")] = None


@router.get("")
def list_jobs(
    context: ContextOf,
    run_id: Annotated[Identifier | None, Query(description="of this run alone")] = None,
    state: Annotated[JobState | None, Query(description="in this state alone")] = None,
    kind: Annotated[JobKind | None, Query(description="of this kind alone")] = None,
    limit: Annotated[int, Query(ge=1, le=10_000, description="at most so many")] = 200,
) -> list[Job]:
    """Jobs, newest first."""
    return context.jobs.newest(run_id, [state] if state else JobState, limit, [kind] if kind else JobKind)


@router.post("", status_code=202, responses=responses(404, 409, 500, 507))
def create_jobs(
    request: ReconstructionRequest, context: ContextOf, who: Who, idempotency_key: IdempotencyKey = None
) -> list[Job]:
    """Queue one job per shot; work that is waiting, running or done already is not repeated."""

    def queue() -> list[Job]:
        return request_reconstruction(context, request.run_id, request.shots, request.calibration, request.settings)

    return _queued_once(context, who, idempotency_key, described("reconstruction", request), queue)


@router.post("/measurements", status_code=202, responses=responses(404, 409, 500, 507))
def create_measurements(
    request: MeasurementRequest, context: ContextOf, who: Who, idempotency_key: IdempotencyKey = None
) -> list[Job]:
    """Queue the measurement of droplets, one job per shot; no volume is needed, and nothing is done twice."""

    def queue() -> list[Job]:
        return request_measurement(context, request.run_id, request.shots, request.calibration, request.settings)

    return _queued_once(context, who, idempotency_key, described("measurement", request), queue)


@router.get("/{job_id}", responses=responses(404))
def show_job(job_id: JobId, context: ContextOf) -> Job:
    """One job."""
    return context.jobs.get(job_id)


@router.post("/{job_id}/abort", status_code=202, responses=responses(404, 409, 507))
async def abort_job(job_id: JobId, context: ContextOf) -> Job:
    """A waiting job ends at once, a running one at its next step."""
    return await context.runner.abort(job_id)


def _queued_once(
    context: Context, who: Visitor, key: str | None, what: str, queue: Callable[[], list[Job]]
) -> list[Job]:
    """Queue jobs at the first time; the same ones, as they are now, at every other."""

    def queued() -> list[str]:
        ids = [job.id for job in queue()]
        tell_deed(context, who, f"asked for {what.partition(' ')[0]} of {counted(len(ids), 'shot')}")
        return ids

    return [context.jobs.get(job_id) for job_id in context.once.do(key, what, queued)]
