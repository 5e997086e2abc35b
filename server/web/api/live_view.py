"""/api/rig/live: start, change and end the live view; its pictures come by ``live``."""

from typing import Annotated

from fastapi import APIRouter
from pydantic import Field

from daq.frozen_model import FrozenModel
from daq.run.state import RunState
from daq.run_plan import LivePlan
from server.lab.live import LiveCaption
from server.lab.starting.command import tell_deed
from server.lab.starting.light_request import obey
from server.web.api.parameters import AsksForLight, ContextOf, Who
from server.web.problems import responses

router = APIRouter(prefix="/api/rig/live", tags=["rig"])


class LiveView(FrozenModel):
    """The live view, and the newest shot of it, or of a run."""

    state: Annotated[RunState, Field(description="where acquisition stands; the rig is shown live in this one alone")]
    plan: Annotated[LivePlan | None, Field(description="what is shown; null unless the state is live")]
    views: Annotated[
        dict[str, LiveCaption], Field(description="the newest shot, by view; empty before the first since the start")
    ]


@router.get("")
def show_live(context: ContextOf) -> LiveView:
    """What is shown."""
    status = context.services.acquisition.status()
    return LiveView(state=status.state, plan=status.live, views=context.live.captions())


@router.put("", responses=responses(409, 412, 423, 503, 504))
def start_live(plan: LivePlan, context: ContextOf, asked: AsksForLight) -> LiveView:
    """Show the rig live; a live view of another plan ends first. Light that this rig does not permit answers 422."""
    start = context.services.acquisition.start_live
    obey(context, asked, f"live {plan.model_dump_json()}", lambda: start(plan))
    return show_live(context)


@router.delete("", status_code=202)
def end_live(context: ContextOf, who: Who) -> LiveView:
    """End the live view after the shot under way; nobody needs control, and without one there is nothing to do."""
    context.services.acquisition.end_live()
    tell_deed(context, who, "ended the live view")
    return show_live(context)
