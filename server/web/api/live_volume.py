"""/api/rig/live/volume: the newest shot of the live view as a volume; who asks, makes it."""

from typing import Annotated, Literal

from fastapi import APIRouter, Path, Query, Response

from server.lab.live_view.live_volume import LiveVolumeView
from server.pictures.surfaces import surface_glb
from server.web.api.parameters import ContextOf
from server.web.problems import responses

VOLUME_PATH = "/api/rig/live/volume"
router = APIRouter(prefix=VOLUME_PATH, tags=["rig"])
_NOW = {"Cache-Control": "no-store"}


@router.get("")
def make_live_volume(context: ContextOf) -> LiveVolumeView:
    """The newest complete shot, at half resolution, by MLOS and the current calibration; in the state LIVE only.

    It is made now, unless somebody else has it made: then the one before is told.
    """
    return context.live_volume.look()


@router.get(
    "/slices/{axis}/{index}.png",
    response_class=Response,
    responses={**responses(404), 200: {"content": {"image/png": {}}}},
)
def show_live_slice(
    axis: Annotated[Literal["x", "y", "z"], Path(description="of the world, across which the slice lies")],
    index: Annotated[int, Path(ge=0, description="plane of the live volume, from 0")],
    context: ContextOf,
) -> Response:
    """A slice of the live volume as it is now, coloured from 0 to 1."""
    return Response(context.live_volume.slice_png(axis, index), media_type="image/png", headers=_NOW)


@router.get(
    "/surface.glb",
    response_class=Response,
    responses={**responses(404), 200: {"content": {"model/gltf-binary": {}}}},
)
def show_live_surface(
    context: ContextOf,
    level: Annotated[float, Query(gt=0, lt=1, description="fraction of the largest intensity")] = 0.3,
) -> Response:
    """Iso-surface of the live volume as it is now, binary glTF in mm; takes longer than slices."""
    glb = surface_glb(context.live_volume.preview(), level)
    return Response(glb, media_type="model/gltf-binary", headers=_NOW)
