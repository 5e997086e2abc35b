"""/api/runs/{run_id}/results/{results_id}/droplets: what was measured, and the files."""

from fastapi import APIRouter
from fastapi.responses import FileResponse

from server.lab.droplets.measured import MeasuredRun, droplets_file, measured_run
from server.web.api.parameters import ContextOf, ResultsId, RunId, ShotIndex
from server.web.opened_file import OpenedFile, opened_file
from server.web.problems import responses

router = APIRouter(prefix="/api/runs/{run_id}/results/{results_id}/droplets", tags=["results"])


@router.get("", responses=responses(404, 500))
def show_droplets(run_id: RunId, results_id: ResultsId, context: ContextOf) -> MeasuredRun:
    """Verdicts shot by shot, the statistics of the spray with their intervals, and what nothing checks."""
    return measured_run(context.runs.directory(run_id) / "results" / results_id)


@router.get("/{shot}.h5", response_class=FileResponse, responses=responses(404))
def download_droplets(run_id: RunId, results_id: ResultsId, shot: ShotIndex, context: ContextOf) -> OpenedFile:
    """The droplets of a shot, HDF5: 1-D columns, a row per droplet and exposure."""
    path = droplets_file(context.runs.directory(run_id) / "results" / results_id, shot)
    return opened_file(path, "application/x-hdf5", f"{run_id}_{results_id}_{path.name}")
