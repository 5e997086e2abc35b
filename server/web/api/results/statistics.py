"""/api/runs/{run_id}/statistics: the spray as a whole, of what is measured so far; and which separation suits it."""

from typing import Annotated

from fastapi import APIRouter, Query

from daq.names import Identifier
from processing.analysis.spray.spray_statistics import LIQUIDS_KG_M3
from processing.analysis.velocity.separation_proposal import MOVED_VOXEL
from server.lab.droplets.proposed_separation import ProposedSeparation, Voxels, proposed_separation
from server.lab.droplets.spray_so_far import SpraySoFar, spray_so_far
from server.web.api.parameters import ContextOf, RunId
from server.web.problems import responses

router = APIRouter(prefix="/api/runs/{run_id}", tags=["results"])
_Results = Annotated[Identifier | None, Query(description="which result set; default: the newest droplets")]


@router.get("/statistics", responses=responses(404, 500))
def show_statistics(
    run_id: RunId,
    context: ContextOf,
    results: _Results = None,
    liquid_kg_m3: Annotated[
        float | None,
        Query(
            ge=LIQUIDS_KG_M3[0],
            le=LIQUIDS_KG_M3[1],
            description="density of the liquid, which makes mass of volume flux",
        ),
    ] = None,
) -> SpraySoFar:
    """Sizes, densities, flux, patternation with intervals, of at most 50 measured shots; while it records, too."""
    return spray_so_far(context.runs, run_id, results, liquid_kg_m3)


@router.get("/separation", responses=responses(404, 500))
def propose_separation(
    run_id: RunId, context: ContextOf, results: _Results = None, voxels: Annotated[Voxels, Query()] = MOVED_VOXEL
) -> ProposedSeparation:
    """How long after A to take B of the next run, by the velocities of measured shots and the cameras of this rig."""
    return proposed_separation(context.runs, context.services.config, run_id, results, voxels)
