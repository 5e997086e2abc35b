"""/api/runs: past runs, and the one that is active."""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Response

from daq.files.run_directory import RunHeader
from daq.run_plan import RunPlan
from server.lab.errors import Conflict
from server.lab.runs.run_summary import RunSummary
from server.lab.starting.light_request import obey
from server.lab.starting.run_start import start_run
from server.web.api.parameters import AsksForLight, ContextOf, RunId
from server.web.api.rig import AcquisitionView, view_of_acquisition
from server.web.problems import responses

router = APIRouter(prefix="/api/runs", tags=["runs"])


_COUNT = "X-Total-Count"
_COUNTED: dict[int | str, dict[str, Any]] = {
    200: {"headers": {_COUNT: {"description": "number of all runs", "schema": {"type": "integer"}}}}
}


@router.get("", responses=_COUNTED)
def list_runs(
    context: ContextOf,
    response: Response,
    limit: Annotated[int, Query(ge=1, le=1000, description="at most so many")] = 100,
    offset: Annotated[int, Query(ge=0, le=10_000_000, description="leave out so many of the newest ones")] = 0,
) -> list[RunSummary]:
    """Runs, newest first."""
    runs, count = context.runs.page(limit, offset)
    response.headers[_COUNT] = str(count)
    return runs


@router.post("", status_code=201, responses=responses(409, 412, 423, 503, 504))
def create_run(plan: RunPlan, context: ContextOf, asked: AsksForLight, response: Response) -> AcquisitionView:
    """Start a run. There is no queue: a busy rig answers 409, a plan that this rig cannot run 422."""
    run_id = obey(context, asked, f"run {plan.model_dump_json()}", lambda: start_run(context, plan))
    response.headers["Location"] = f"/api/runs/{run_id}"
    return view_of_acquisition(context)


@router.get("/{run_id}", responses=responses(404))
def show_run(run_id: RunId, context: ContextOf) -> RunSummary:
    """What a run is and how it went."""
    return context.runs.summary(run_id)


@router.get("/{run_id}/header", responses=responses(404, 500))
def show_header(run_id: RunId, context: ContextOf) -> RunHeader:
    """Plan, configuration, devices and versions, as they were when the run started."""
    return context.runs.reader(run_id).header


@router.post("/{run_id}/stop", status_code=202, responses=responses(409))
def stop_run(run_id: RunId, context: ContextOf) -> AcquisitionView:
    """End the run after the present shot."""
    _require_active(run_id, context)
    context.services.acquisition.stop()
    return view_of_acquisition(context)


@router.post("/{run_id}/abort", status_code=202, responses=responses(409, 503, 504))
def abort_run(run_id: RunId, context: ContextOf) -> AcquisitionView:
    """End the run now: light off first."""
    _require_active(run_id, context)
    context.services.acquisition.abort()
    return view_of_acquisition(context)


def _require_active(run_id: str, context: ContextOf) -> None:
    status = context.services.acquisition.status()
    if status.run_id != run_id or not status.active:
        raise Conflict(f"run {run_id} is not active; acquisition is {status.state}")
