"""/api/runs/{run_id}/results/{results_id}/{volume}: slices and regions at full resolution, made when asked for.

A slice takes some milliseconds of CPU once its exposure has been looked at. Every value is, bit by bit, that of the
whole volume.
"""

from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response

from processing.reconstruction.choices import ReconstructionMethod
from processing.runs.volumes.volume_parts import VolumePart
from server.lab.results import part_of, preview_of, volume_file
from server.lab.services import Context
from server.pictures.pictures import Colours, plane_png
from server.web.api.parameters import ContextOf, ResultsId, RunId
from server.web.api.results.results import ColoursOf, VolumeName
from server.web.problems import responses

router = APIRouter(prefix="/api/runs/{run_id}/results/{results_id}/{volume}", tags=["results"])

_NUMBER = r"-?[0-9]{1,6}(\.[0-9]{1,9})?"
_RANGE = rf"^{_NUMBER}(:{_NUMBER})?$"
_PROBLEMS = responses(404, 409, 500)
LineOfSight = Annotated[
    ReconstructionMethod | None,
    Query(description="by another line-of-sight method than the volume was made by; smart and mart have no parts"),
]
Range = Annotated[
    str | None, Query(pattern=_RANGE, description="from:to in mm, or one place for the nearest plane; default: all")
]
Axis = Annotated[Literal["x", "y", "z"], Query(description="of the world, across which the picture lies")]
Limit = Annotated[float | None, Query(gt=0, le=1e6, description="intensity of the brightest colour")]
_PICTURE = {**_PROBLEMS, 200: {"content": {"image/png": {}}}}


@router.get("/slice.png", response_class=Response, responses=_PICTURE)
def show_full_slice(
    run_id: RunId,
    results_id: ResultsId,
    volume: VolumeName,
    context: ContextOf,
    axis: Axis,
    at_mm: Annotated[float, Query(ge=-1e6, le=1e6, description="where; the nearest plane is shown")],
    method: LineOfSight = None,
    colours: ColoursOf = Colours.HEAT,
    limit: Limit = None,
) -> Response:
    """A slice of the volume, coloured as its preview; by another method, up to the brightest voxel of the slice."""
    part = _part(context, run_id, results_id, volume, {axis: (at_mm, at_mm)}, method)
    file = volume_file(context.runs.directory(run_id), results_id, volume)
    brightest = limit or (preview_of(file).limit if method is None else float(part.voxels.max()))
    name = f"{run_id}_{results_id}_{volume}_{part.method.value}_{axis}_{at_mm:.3f}_mm.png"
    return _picture(part, axis, brightest, colours, name)


@router.get("/region.png", response_class=Response, responses=_PICTURE)
def show_region_maximum(
    run_id: RunId,
    results_id: ResultsId,
    volume: VolumeName,
    context: ContextOf,
    axis: Axis,
    x_mm: Range = None,
    y_mm: Range = None,
    z_mm: Range = None,
    method: LineOfSight = None,
    colours: ColoursOf = Colours.HEAT,
    limit: Limit = None,
) -> Response:
    """The largest values of a region along an axis, coloured up to the brightest one of them."""
    ranges_mm = {"x": _span(x_mm), "y": _span(y_mm), "z": _span(z_mm)}
    part = _part(context, run_id, results_id, volume, ranges_mm, method)
    name = f"{run_id}_{results_id}_{volume}_{part.method.value}_region_{axis}.png"
    return _picture(part, axis, limit or float(part.voxels.max()), colours, name)


@router.get(
    "/region.f32",
    response_class=Response,
    responses={**_PROBLEMS, 200: {"content": {"application/octet-stream": {}}}},
)
def show_region(
    run_id: RunId,
    results_id: ResultsId,
    volume: VolumeName,
    context: ContextOf,
    x_mm: Range = None,
    y_mm: Range = None,
    z_mm: Range = None,
    method: LineOfSight = None,
) -> Response:
    """Intensities, float32 little-endian, z slowest and x fastest; headers say shape, place and method.

    ``Tomoshadow-Shape`` are the voxels along z, y, x; ``Tomoshadow-Origin-Mm`` is x, y, z of the first one's centre,
    ``Tomoshadow-Pitch-Mm`` the edge of each. One place instead of a range makes a slice.
    """
    ranges_mm = {"x": _span(x_mm), "y": _span(y_mm), "z": _span(z_mm)}
    part = _part(context, run_id, results_id, volume, ranges_mm, method)
    name = _named(f"{run_id}_{results_id}_{volume}_{part.method.value}_region.f32")
    voxels = part.voxels.astype("<f4", copy=False).tobytes()
    return Response(voxels, media_type="application/octet-stream", headers={**_place(part), **name})


def _part(
    context: Context,
    run_id: str,
    results_id: str,
    volume: str,
    ranges_mm: dict[str, tuple[float, float] | None],
    method: ReconstructionMethod | None,
) -> VolumePart:
    file = volume_file(context.runs.directory(run_id), results_id, volume)
    return part_of(context.parts, file, context.calibrations, ranges_mm, method)


def _picture(part: VolumePart, axis: str, brightest: float, colours: Colours, name: str) -> Response:
    plane = part.voxels.max("zyx".index(axis))
    png = plane_png(plane.T if axis == "x" else plane, brightest, colours)
    return Response(png, media_type="image/png", headers={**_place(part), **_named(name)})


def _span(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    low, _, high = text.partition(":")
    return float(low), float(high or low)


def _named(file: str) -> dict[str, str]:
    """Name of a download; no two parts have the same. Ids hold nothing that has to be quoted."""
    return {"Content-Disposition": f'inline; filename="{file}"'}


def _place(part: VolumePart) -> dict[str, str]:
    grid = part.grid
    return {
        "Tomoshadow-Shape": ",".join(map(str, grid.shape)),
        "Tomoshadow-Origin-Mm": ",".join(map(repr, grid.origin_mm)),
        "Tomoshadow-Pitch-Mm": repr(grid.pitch_mm),
        "Tomoshadow-Method": part.method.value,
    }
