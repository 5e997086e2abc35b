"""/api/calibrations: calibration files, which one is current, and making one from a calibration run."""

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Response
from pydantic import Field

from daq.frozen_model import FrozenModel
from daq.names import Identifier
from daq.run_plan import RunKind
from server.lab.calibrations import CalibrationSummary
from server.lab.errors import Unprocessable
from server.lab.jobs import Job, calibration_job
from server.lab.starting.run_start import choose_calibration as choose
from server.web.api.parameters import CalibrationId, ContextOf
from server.web.problems import responses

router = APIRouter(prefix="/api/calibrations", tags=["calibrations"])


class CalibrationRequest(FrozenModel):
    """Make a calibration from a run."""

    run_id: Annotated[Identifier, Field(description="a run of kind calibration")]
    model: Annotated[
        Literal["pinhole", "pinhole_tilted", "polynomial", "auto"],
        Field(description="camera model; auto: the one with the least hold-out error"),
    ] = "pinhole"


class CurrentCalibration(FrozenModel):
    """Choose the calibration for runs that name none."""

    id: Annotated[Identifier, Field(description="one of the calibrations that are listed")]


@router.get("")
def list_calibrations(context: ContextOf) -> list[CalibrationSummary]:
    """Calibrations, newest first."""
    return context.calibrations.list()


@router.post("", status_code=202, responses=responses(404, 500))
def create_calibration(request: CalibrationRequest, context: ContextOf, response: Response) -> Job:
    """Queue the fit; ``Location`` names the job, its result the calibration."""
    summary = context.runs.summary(request.run_id)
    context.runs.require_sound(summary)
    if summary.kind not in (RunKind.CALIBRATION, None):
        raise Unprocessable(f"run {request.run_id} is a {summary.kind} run, a calibration run is needed")
    job = context.runner.submit(calibration_job(request.run_id, f"{request.run_id}-{request.model}", request.model))
    response.headers["Location"] = f"/api/jobs/{job.id}"
    return job


@router.put("/current", responses=responses(404, 500))
def choose_calibration(choice: CurrentCalibration, context: ContextOf) -> CurrentCalibration:
    """Use this one for sample runs that name none."""
    choose(context, choice.id)
    return choice


@router.get("/{calibration_id}", responses=responses(404, 500))
def show_calibration(calibration_id: CalibrationId, context: ContextOf) -> dict[str, Any]:
    """The calibration file: camera models, residuals per plane, hold-out errors, verdicts."""
    return context.calibrations.document(calibration_id)
