"""/api/runs/{run_id}/results: volumes, and pictures of their previews.

Pictures have y pointing down, as camera images do: slices across z show x to the right, slices across x show z to the
right; slices across y show x to the right and z down.
"""

from asyncio import to_thread
from pathlib import Path as FilePath
from typing import Annotated, Literal

import numpy as np
from fastapi import APIRouter, Path, Query, Response
from fastapi.responses import FileResponse
from numpy.typing import NDArray
from pydantic import Field

from daq.frozen_model import FrozenModel
from server.lab.errors import NotFound
from server.lab.results import ResultSet, preview_of, result_sets, surface_of, volume_file
from server.lab.services import Context
from server.pictures.pictures import Colours, plane_png
from server.pictures.previews import VolumePreview
from server.web.api.parameters import ContextOf, ResultsId, RunId
from server.web.opened_file import OpenedFile, opened_file
from server.web.problems import responses

router = APIRouter(prefix="/api/runs/{run_id}/results", tags=["results"])

Axis = Annotated[Literal["x", "y", "z"], Path(description="axis of the world across which the picture lies")]
VolumeName = Annotated[str, Path(pattern=r"^shot_[0-9]{5,7}_[ab]$", description="for example shot_00012_a")]
ColoursOf = Annotated[Colours, Query(description="heat; blue and red can be laid one upon the other")]
_PNG = {**responses(404, 409, 500), 200: {"content": {"image/png": {}}}}


class PreviewView(FrozenModel):
    """Where the voxels of a preview lie; slices are numbered along its axes."""

    shape: Annotated[tuple[int, int, int], Field(description="voxels along z, y, x")]
    origin_mm: Annotated[tuple[float, float, float], Field(description="centre of voxel [0, 0, 0], x, y, z")]
    pitch_mm: Annotated[float, Field(description="edge of a voxel of the preview")]
    limit: Annotated[float, Field(description="largest intensity of the volume; the brightest colour stands for it")]
    full_shape: Annotated[tuple[int, int, int], Field(description="voxels of the volume itself along z, y, x")]


@router.get("", responses=responses(404))
def list_results(run_id: RunId, context: ContextOf) -> list[ResultSet]:
    """Result sets with their volumes, newest first."""
    return result_sets(context.runs.directory(run_id))


@router.get("/{results_id}/{volume}", responses=responses(404, 409, 500))
def show_preview(run_id: RunId, results_id: ResultsId, volume: VolumeName, context: ContextOf) -> PreviewView:
    """Size and place of a preview."""
    preview = preview_of(volume_file(context.runs.directory(run_id), results_id, volume))
    grid = preview.grid
    return PreviewView(
        shape=grid.shape,
        origin_mm=grid.origin_mm,
        pitch_mm=grid.pitch_mm,
        limit=preview.limit,
        full_shape=preview.full_shape,
    )


@router.get("/{results_id}/{volume}/volume.vtkhdf", response_class=FileResponse, responses=responses(404, 409, 500))
async def download_volume(run_id: RunId, results_id: ResultsId, volume: VolumeName, context: ContextOf) -> OpenedFile:
    """The volume itself, VTKHDF ImageData; ParaView opens it. Only a preview is kept until somebody asks for it."""
    path = await to_thread(_volume, context, run_id, results_id, volume)
    if not await to_thread(path.is_file):
        await context.runner.store(path)
    name = f"{run_id}_{results_id}_{path.name}"
    return await to_thread(opened_file, path, "application/x-hdf5", name)


@router.get("/{results_id}/{volume}/slices/{axis}/{index}.png", response_class=Response, responses=_PNG)
def show_slice(
    run_id: RunId,
    results_id: ResultsId,
    volume: VolumeName,
    axis: Axis,
    index: Annotated[int, Path(ge=0, description="number of the plane along the axis, from 0")],
    context: ContextOf,
    colours: ColoursOf = Colours.HEAT,
) -> Response:
    """One plane of the preview, coloured from 0 to the largest value of the volume."""
    preview = preview_of(volume_file(context.runs.directory(run_id), results_id, volume))
    return _picture(_plane(preview, axis, index), axis, colours)


@router.get("/{results_id}/{volume}/projections/{axis}.png", response_class=Response, responses=_PNG)
def show_projection(
    run_id: RunId,
    results_id: ResultsId,
    volume: VolumeName,
    axis: Axis,
    context: ContextOf,
    colours: ColoursOf = Colours.HEAT,
) -> Response:
    """Maximum along an axis."""
    preview = preview_of(volume_file(context.runs.directory(run_id), results_id, volume))
    return _picture(preview.projection(axis), axis, colours)


@router.get(
    "/{results_id}/{volume}/surface.glb",
    response_class=Response,
    responses={**responses(404, 409, 500), 200: {"content": {"model/gltf-binary": {}}}},
)
def show_surface(
    run_id: RunId,
    results_id: ResultsId,
    volume: VolumeName,
    context: ContextOf,
    level: Annotated[float, Query(gt=0, lt=1, description="fraction of the largest value")] = 0.35,
) -> Response:
    """Iso-surface in mm; axes (x, -y, -z) of the world, so that viewers show the spray upright."""
    mesh = surface_of(volume_file(context.runs.directory(run_id), results_id, volume), round(level, 3))
    return Response(mesh, media_type="model/gltf-binary")


def _volume(context: Context, run_id: str, results_id: str, volume: str) -> FilePath:
    """Its file, that of a former run not."""
    path = volume_file(context.runs.directory(run_id), results_id, volume)
    if path.is_file():
        preview_of(path)
    return path


def _plane(preview: VolumePreview, axis: Axis, index: int) -> NDArray[np.uint8]:
    try:
        return preview.plane(axis, index)
    except IndexError as error:
        raise NotFound(str(error)) from error


def _picture(plane: NDArray[np.uint8], axis: Axis, colours: Colours) -> Response:
    upright = plane.T if axis == "x" else plane
    return Response(plane_png(upright, 255, colours), media_type="image/png")
