"""/api/runs: past runs, and the one that is active."""

from typing import Annotated, Any

from fastapi import APIRouter, Header, Query, Response

from daq.files.run_directory import RunHeader
from daq.run_plan import RunKind, RunPlan
from server.lab.desk.once import described
from server.lab.errors import Conflict
from server.lab.runs.notes_change import NewNotes, NotesHistory, change_notes, notes_history
from server.lab.runs.run_filter import MOST_TEXT, ListedOutcome, RunFilter
from server.lab.runs.run_removal import RemovedRun, remove_run
from server.lab.runs.run_summary import RunSummary
from server.lab.runs.thumbnail import thumbnail_of
from server.lab.starting.command import command, tell_deed
from server.lab.starting.light_request import obey
from server.lab.starting.run_start import start_run
from server.web.api.at_once import at_once
from server.web.api.parameters import AsksForLight, ContextOf, RunId, Who
from server.web.api.rig import AcquisitionView, view_of_acquisition
from server.web.problems import responses

router = APIRouter(prefix="/api/runs", tags=["runs"])

_COUNT = "X-Total-Count"
_COUNTED: dict[int | str, dict[str, Any]] = {
    200: {"headers": {_COUNT: {"description": "number of all runs that are wanted", "schema": {"type": "integer"}}}}
}


@router.get("", responses=_COUNTED)
def list_runs(
    context: ContextOf,
    response: Response,
    limit: Annotated[int, Query(ge=1, le=1000, description="at most so many")] = 100,
    offset: Annotated[int, Query(ge=0, le=10_000_000, description="leave out so many of the newest ones")] = 0,
    kind: Annotated[RunKind | None, Query(description="of this kind alone")] = None,
    outcome: Annotated[ListedOutcome | None, Query(description="that ended like this alone")] = None,
    text: Annotated[
        str, Query(max_length=MOST_TEXT, description="words, all of which id, name, cause, references or notes hold")
    ] = "",
    results: Annotated[bool | None, Query(description="true: with results; false: without any")] = None,
) -> list[RunSummary]:
    """Runs, newest first."""
    wanted = RunFilter(kind=kind, outcome=outcome, text=text, results=results)
    runs, count = context.runs.page(limit, offset, wanted)
    response.headers[_COUNT] = str(count)
    return runs


@router.post("", status_code=201, responses=responses(409, 412, 423, 503, 504))
def create_run(plan: RunPlan, context: ContextOf, asked: AsksForLight, response: Response) -> AcquisitionView:
    """Start a run. There is no queue: a busy rig answers 409, a plan that this rig cannot run 422."""
    run_id = obey(context, asked, described("run", plan), lambda: start_run(context, plan))
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


@router.get("/{run_id}/notes", responses=responses(404, 500))
def show_notes(run_id: RunId, context: ContextOf) -> NotesHistory:
    """Notes as they were recorded, and every change since: who, when, and what stood before."""
    return notes_history(context.runs, run_id)


@router.put("/{run_id}/notes", responses=responses(404, 409, 423, 500, 507))
def put_notes(run_id: RunId, new: NewNotes, context: ContextOf, who: Who) -> RunSummary:
    """Change the notes of a run that is over; its own file stays as it was recorded, what stood before is kept."""
    deed = f"changed the notes of run {run_id}"
    return command(context, who, deed, lambda: change_notes(context.runs, run_id, new, who.name))


@router.get(
    "/{run_id}/thumbnail.jpg",
    response_class=Response,
    responses={**responses(404), 200: {"content": {"image/jpeg": {}}}},
)
def show_thumbnail(
    run_id: RunId,
    context: ContextOf,
    shot: Annotated[int, Query(ge=0, lt=10**9, description="of the run, from 0")] = 0,
) -> Response:
    """A small picture: exposure A of a shot, by the first view that has it."""
    return Response(thumbnail_of(context.runs.directory(run_id), shot), media_type="image/jpeg")


@router.delete("/{run_id}", responses=responses(404, 409, 423, 507))
def delete_run(
    run_id: RunId,
    context: ContextOf,
    who: Who,
    tomoshadow_name: Annotated[str, Header(max_length=300, description="the id of the run once more, as typed")],
) -> RemovedRun:
    """Delete a run for ever, with its results and jobs; one that is being recorded or worked on is refused with 409."""
    stores = context.runs, context.unkept_runs, context.jobs
    return command(context, who, f"deleted run {run_id}", lambda: remove_run(*stores, run_id, tomoshadow_name))


@router.post("/{run_id}/stop", status_code=202, responses=responses(409))
async def stop_run(run_id: RunId, context: ContextOf, who: Who) -> AcquisitionView:
    """End the run after the present shot; nobody needs control for that."""
    _require_active(run_id, context)
    await at_once(context.services.acquisition.stop)
    tell_deed(context, who, f"stopped run {run_id}")
    return view_of_acquisition(context)


@router.post("/{run_id}/abort", status_code=202, responses=responses(409, 503, 504))
async def abort_run(run_id: RunId, context: ContextOf, who: Who) -> AcquisitionView:
    """End the run now: light off first; nobody needs control for that."""
    _require_active(run_id, context)
    await at_once(context.services.acquisition.abort)
    tell_deed(context, who, f"aborted run {run_id}")
    return view_of_acquisition(context)


def _require_active(run_id: str, context: ContextOf) -> None:
    status = context.services.acquisition.status()
    if status.run_id != run_id or not status.active:
        raise Conflict(f"run {run_id} is not active; acquisition is {status.state}")
