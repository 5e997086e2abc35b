"""/api/runs/{run_id}/shots: what was recorded, and pictures of it."""

from typing import Annotated, Literal

from fastapi import APIRouter, Path, Query, Response
from pydantic import Field

from daq.files.run_directory import ExposureRecord, FiredTrain
from daq.frozen_model import FrozenModel
from daq.names import ViewName
from daq.run_plan import ImageKey
from server.lab.errors import NotFound
from server.lab.runs.shot_seen import fault_of, shot_of
from server.pictures.pictures import Stretch, frame_png
from server.web.api.parameters import ContextOf, RunId, ShotIndex
from server.web.problems import responses

router = APIRouter(prefix="/api/runs/{run_id}/shots", tags=["shots"])


class ShotView(FrozenModel):
    """One shot in a list."""

    index: Annotated[int, Field(description="position in the run, from 0")]
    image_key: Annotated[str, Field(description="what it shows: sample, flat, dark, invalid or background")]


class ShotDetail(FrozenModel):
    """One shot: what each camera and the pulse generator said."""

    index: Annotated[int, Field(description="position in the run, from 0")]
    image_key: Annotated[str, Field(description="what it shows: sample, flat, dark, invalid or background")]
    fault: Annotated[str, Field(description="why it is invalid; empty where it is valid")]
    host_time_ns: Annotated[int, Field(description="Unix time of the firing; 0 for imported images")]
    stage_z_mm: Annotated[float | None, Field(description="position of the calibration target, where there is one")]
    fired: Annotated[FiredTrain | None, Field(description="the actual pulse train; null for imported images")]
    exposures: Annotated[
        dict[str, dict[str, ExposureRecord]], Field(description="what each camera said, by view and by exposure a, b")
    ]


@router.get("", responses=responses(404, 500))
def list_shots(
    run_id: RunId,
    context: ContextOf,
    limit: Annotated[int, Query(ge=1, le=100_000, description="at most so many")] = 100_000,
    offset: Annotated[int, Query(ge=0, le=100_000, description="leave out so many of the first ones")] = 0,
) -> list[ShotView]:
    """All shots of a run, or some of them."""
    keys = context.runs.image_keys(run_id).tolist()[offset : offset + limit]
    return [ShotView(index=index, image_key=ImageKey(key).name.lower()) for index, key in enumerate(keys, start=offset)]


@router.get("/{shot}", responses=responses(404, 500))
def show_shot(run_id: RunId, shot: ShotIndex, context: ContextOf) -> ShotDetail:
    """Frame ids, timestamps, packet counters and the actual pulse train."""
    recorded = shot_of(context.runs.reader(run_id), shot)
    return ShotDetail(
        index=recorded.index,
        image_key=recorded.image_key.name.lower(),
        fault=fault_of(recorded),
        host_time_ns=recorded.host_time_ns,
        stage_z_mm=recorded.stage_z_mm,
        fired=recorded.fired,
        exposures={view: {"a": frames.record_a, "b": frames.record_b} for view, frames in recorded.views.items()},
    )


@router.get(
    "/{shot}/{view}/{frame}.png",
    response_class=Response,
    responses={**responses(404, 500), 200: {"content": {"image/png": {}}}},
)
def show_frame(
    run_id: RunId,
    shot: ShotIndex,
    view: Annotated[ViewName, Path(description="name of a view of the run")],
    frame: Annotated[Literal["a", "b"], Path(description="first or second exposure")],
    context: ContextOf,
    stretch: Annotated[
        Stretch, Query(description="auto: 0.1 % to 99.9 % quantile, at least 1/8 of the bit depth; full: all of it")
    ] = Stretch.AUTO,
    width_px: Annotated[int | None, Query(ge=16, le=8192, description="narrower than the frame")] = None,
) -> Response:
    """One exposure as an 8 bit picture; the raw values are in the shot file."""
    run = context.runs.reader(run_id)
    exposures = shot_of(run, shot).views.get(view)
    image = None if exposures is None else exposures.frame_a if frame == "a" else exposures.frame_b
    if image is None:
        raise NotFound(f"run {run_id}, shot {shot} has no exposure {frame} of {view!r}")
    return Response(frame_png(image, run.header.views[view].bits, stretch, width_px), media_type="image/png")
