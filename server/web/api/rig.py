"""/api/rig: lamps, state of acquisition, configuration; acknowledging a fault, aborting whatever runs."""

from typing import Annotated, Any

from fastapi import APIRouter
from pydantic import ConfigDict, Field

from daq.frozen_model import FrozenModel
from daq.run.state import RunOutcome, RunState
from server.lab.duty import Lamp
from server.lab.runs.run_summary import RunCause
from server.lab.starting.abort import abort_all
from server.lab.starting.command import tell_deed
from server.lab.watch import CalibrationStanding
from server.web.api.at_once import at_once
from server.web.api.parameters import AbortPort, ContextOf, Who
from server.web.problems import responses

router = APIRouter(prefix="/api/rig", tags=["rig"])


class AcquisitionView(FrozenModel):
    """State of acquisition, and the counts of the present or last run."""

    model_config = ConfigDict(from_attributes=True)

    state: Annotated[RunState, Field(description="where acquisition stands")]
    outcome: Annotated[RunOutcome | None, Field(description="of the last run; null while one is active")]
    run_id: Annotated[str | None, Field(description="the active run, or the last one; null before the first")]
    shots_planned: Annotated[int, Field(description="of that run")]
    shots_recorded: Annotated[int, Field(description="shots on the disk")]
    shots_valid: Annotated[int, Field(description="shots with every exposure, and light where it belongs")]
    message: Annotated[str, Field(description="what happened last; the cause where a run has failed")]
    to_acknowledge: Annotated[
        tuple[RunCause, ...],
        Field(
            description="several causes of what ended last, each to be acknowledged by itself before anything starts"
        ),
    ]


class RigView(FrozenModel):
    """The rig at a glance."""

    name: Annotated[str, Field(description="of the rig, from its configuration")]
    simulated: Annotated[bool, Field(description="true: its devices are simulated")]
    views: Annotated[list[str], Field(description="names of the lines of sight, in the order of the live view")]
    lamps: Annotated[tuple[Lamp, ...], Field(description="every device, and work in the background that fails")]
    acquisition: Annotated[AcquisitionView, Field(description="what acquisition does")]
    beat: Annotated[int, Field(description="of /api/beat, now; a script names it where it asks for light")]
    abort_port: Annotated[int, Field(description="TCP port of ABORT alone; it answers while this one is busy")]
    calibration: Annotated[
        CalibrationStanding | None,
        Field(description="how the calibration in use fitted the last shot that was checked; null: nothing is known"),
    ]


@router.get("")
async def show_rig(context: ContextOf, abort_port: AbortPort) -> RigView:
    """State of every device and of acquisition; devices are asked once a second."""
    config = context.services.config
    return RigView(
        name=config.name,
        simulated=config.simulation is not None,
        views=list(config.views),
        lamps=context.lamps,
        acquisition=view_of_acquisition(context),
        beat=context.beat.number,
        abort_port=abort_port,
        calibration=context.standing,
    )


@router.get("/configuration")
async def show_configuration(context: ContextOf) -> dict[str, Any]:
    """Configuration of the rig as it was read; tokens are masked."""
    return context.services.config.model_dump(mode="json")


@router.post("/abort", status_code=202, responses=responses(503, 504))
async def abort_everything(context: ContextOf, who: Who) -> AcquisitionView:
    """Light off at once, whatever runs, and if nothing does. Its own port answers while the server is busy."""
    await at_once(lambda: abort_all(context.services))
    tell_deed(context, who, "pressed ABORT")
    return view_of_acquisition(context)


@router.post("/acknowledge", status_code=202, responses=responses(409, 423, 503, 504))
def acknowledge_fault(context: ContextOf, who: Who) -> AcquisitionView:
    """The operator has seen to a fault, or to the first of several causes; the last one ends the state FAULT."""
    context.services.acquisition.acknowledge()
    tell_deed(context, who, "acknowledged a fault")
    return view_of_acquisition(context)


def view_of_acquisition(context: ContextOf) -> AcquisitionView:
    """State of acquisition now."""
    return AcquisitionView.model_validate(context.services.acquisition.status())
