"""How long after A to take B: proposed from the velocities of a run, within what the cameras of this rig accept."""

from typing import Annotated

from pydantic import Field

from daq.errors import PlanError
from daq.frozen_model import FrozenModel
from processing.analysis.droplets.droplet_file import DropletFileError
from processing.analysis.velocity.separation_proposal import MOVED_VOXEL, SeparationProposal, propose_separation
from processing.runs.droplets_in_place import read_in_place
from server.lab.droplets.spray_so_far import measured_sample
from server.lab.errors import Damaged
from server.lab.runs.run_store import RunStore
from server.rig.config import RigConfig
from server.rig.optics_table import optics_table

Voxels = Annotated[float, Field(gt=0, le=25, description="that the median droplet should move by")]


class ProposedSeparation(FrozenModel):
    """A separation for the next run, and of which shots."""

    results: Annotated[str, Field(description="result set of the droplets")]
    shots: Annotated[tuple[int, ...], Field(description="whose droplets were asked; three will do")]
    window_ns: Annotated[tuple[int, int] | None, Field(description="that all cameras of this rig accept")]
    window_reason: Annotated[str | None, Field(description="why that is null")] = None
    proposal: Annotated[SeparationProposal, Field(description="what is proposed, or why nothing is")]


def proposed_separation(
    runs: RunStore, config: RigConfig, run_id: str, results: str | None = None, voxels: float = MOVED_VOXEL
) -> ProposedSeparation:
    """Propose a separation from the shots of a run that are measured.

    Raises
    ------
    NotFound
        There is no such run, or nothing of it is measured.
    Damaged
        A file of droplets cannot be read.
    """
    sample = measured_sample(runs, run_id, results)
    window_ns = _window_ns(config)
    try:
        stored = [read_in_place(file) for file in sample.files]
    except (DropletFileError, OSError) as error:
        raise Damaged(str(error)) from error
    allowed_ns = None if isinstance(window_ns, str) else window_ns
    return ProposedSeparation(
        results=sample.results,
        shots=sample.shots,
        window_ns=allowed_ns,
        window_reason=window_ns if isinstance(window_ns, str) else None,
        proposal=propose_separation(stored, allowed_ns, voxels),
    )


def _window_ns(config: RigConfig) -> tuple[int, int] | str:
    """What all cameras accept, or why that is not known."""
    try:
        shortest_ns, longest_ns = optics_table(config)["straddling_window_ns"]
    except PlanError as error:
        return str(error)
    return shortest_ns, longest_ns
