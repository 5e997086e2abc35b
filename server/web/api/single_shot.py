"""/api/rig/shot: one shot, which the next one takes the place of unless it is kept."""

from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import Field

from daq.frozen_model import FrozenModel
from daq.names import Identifier
from server.lab.desk.once import described
from server.lab.starting.light_request import obey
from server.lab.starting.run_start import SingleShot, shoot
from server.web.api.parameters import AsksForLight, ContextOf
from server.web.api.rig import AcquisitionView, view_of_acquisition
from server.web.problems import responses

router = APIRouter(prefix="/api/rig/shot", tags=["rig"])


class UnkeptView(FrozenModel):
    """Single shots that nobody has kept."""

    run_ids: Annotated[tuple[str, ...], Field(description="runs of one shot each; the next single shot removes them")]


class ShotToKeep(FrozenModel):
    """A single shot that shall stay."""

    run_id: Annotated[Identifier, Field(description="its run")]


@router.get("")
async def list_unkept(context: ContextOf) -> UnkeptView:
    """Single shots that nobody has kept; as a rule the last one."""
    return UnkeptView(run_ids=context.unkept_runs.ids)


@router.post("", status_code=201, responses=responses(409, 412, 423, 503, 504))
def take_shot(shot: SingleShot, context: ContextOf, asked: AsksForLight, response: Response) -> AcquisitionView:
    """Take one shot as a run of its own; a live view ends first. It is reconstructed on request only."""
    run_id = obey(context, asked, described("shot", shot), lambda: shoot(context, shot))
    response.headers["Location"] = f"/api/runs/{run_id}"
    return view_of_acquisition(context)


@router.post("/keep", responses=responses(404, 500, 507))
def keep_shot(shot: ShotToKeep, context: ContextOf) -> UnkeptView:
    """Keep a single shot: no later one removes its run."""
    context.runs.summary(shot.run_id)
    context.unkept_runs.keep(shot.run_id)
    return UnkeptView(run_ids=context.unkept_runs.ids)
