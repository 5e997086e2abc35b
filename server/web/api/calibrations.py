"""/api/calibrations: calibration files, which one is current, and making one from a calibration run."""

from typing import Annotated, Any

from fastapi import APIRouter, Path, Response
from fastapi.responses import FileResponse
from pydantic import Field

from daq.frozen_model import FrozenModel
from daq.names import Identifier
from server.lab.calibration_story import CalibrationStory, story_of
from server.lab.calibrations import CalibrationSummary
from server.lab.desk.once import described
from server.lab.errors import NotFound
from server.lab.jobs.job import Job
from server.lab.starting.calibrating import CameraModel, request_calibration, use_calibration
from server.web.api.parameters import CalibrationId, ContextOf, IdempotencyKey, Who
from server.web.opened_file import OpenedFile, opened_file
from server.web.problems import responses

router = APIRouter(prefix="/api/calibrations", tags=["calibrations"])


class CalibrationRequest(FrozenModel):
    """Make a calibration from a run."""

    run_id: Annotated[Identifier, Field(description="a run of kind calibration")]
    model: Annotated[
        CameraModel,
        Field(description="camera model; auto: the one with the least hold-out error"),
    ] = "pinhole"


class CurrentCalibration(FrozenModel):
    """Choose the calibration for runs that name none."""

    id: Annotated[Identifier, Field(description="one of the calibrations that are listed")]


@router.get("")
def list_calibrations(context: ContextOf) -> list[CalibrationSummary]:
    """Calibrations, newest first."""
    return context.calibrations.list()


@router.post("", status_code=202, responses=responses(404, 409, 500, 507))
def create_calibration(
    request: CalibrationRequest,
    context: ContextOf,
    response: Response,
    who: Who,
    idempotency_key: IdempotencyKey = None,
) -> Job:
    """Queue the fit; ``Location`` names the job, its result the calibration."""
    what = described("calibration", request)
    job_id = context.once.do(
        idempotency_key, what, lambda: request_calibration(context, request.run_id, request.model, who).id
    )
    response.headers["Location"] = f"/api/jobs/{job_id}"
    return context.jobs.get(job_id)


@router.put("/current", responses=responses(404, 423, 500, 507))
def choose_calibration(choice: CurrentCalibration, context: ContextOf, who: Who) -> CurrentCalibration:
    """Use this one for sample runs that name none; needs control of the rig."""
    use_calibration(context, who, choice.id)
    return choice


@router.get("/{calibration_id}/story", responses=responses(404, 500))
def tell_calibration(calibration_id: CalibrationId, context: ContextOf) -> CalibrationStory:
    """Verdicts, residuals by view and plane, the worst plane, and what would make it better."""
    return story_of(context, calibration_id)


@router.get(
    "/{calibration_id}/pictures/{picture}.png",
    response_class=FileResponse,
    responses={**responses(404), 200: {"content": {"image/png": {}}}},
)
def show_picture(
    calibration_id: CalibrationId,
    picture: Annotated[Identifier, Path(description="one of the pictures that its story names")],
    context: ContextOf,
) -> OpenedFile:
    """A picture that was drawn when the calibration was made."""
    path = context.calibrations.picture_folder(calibration_id) / f"{picture}.png"
    if not path.is_file():
        raise NotFound(f"calibration {calibration_id!r} has no picture {picture!r}")
    return opened_file(path, "image/png")


@router.get("/{calibration_id}", responses=responses(404, 500))
def show_calibration(calibration_id: CalibrationId, context: ContextOf) -> dict[str, Any]:
    """The calibration file: camera models, residuals per plane, hold-out errors, verdicts."""
    return context.calibrations.document(calibration_id)
