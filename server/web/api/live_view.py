"""/api/rig/live: start, change and end the live view; its pictures come by ``live``."""

from typing import Annotated

from fastapi import APIRouter, Path, Query, Response
from pydantic import Field

from daq.frozen_model import FrozenModel
from daq.names import ViewName
from daq.run.state import RunState
from daq.run_plan import LivePlan
from server.lab.desk.once import described
from server.lab.live_view.live_feed import ExposureName, LiveCaption
from server.lab.starting.command import tell_deed
from server.lab.starting.light_request import obey
from server.pictures.pictures import Stretch, frame_png, square_at
from server.web.api.at_once import at_once
from server.web.api.parameters import AsksForLight, ContextOf, Who
from server.web.problems import responses

PIXELS_PATH = "/api/rig/live"
router = APIRouter(prefix=PIXELS_PATH, tags=["rig"])


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
    obey(context, asked, described("live", plan), lambda: start(plan))
    return show_live(context)


@router.delete("", status_code=202)
async def end_live(context: ContextOf, who: Who) -> LiveView:
    """End the live view after the shot under way; nobody needs control, and without one there is nothing to do."""
    await at_once(context.services.acquisition.end_live)
    tell_deed(context, who, "ended the live view")
    return await at_once(lambda: show_live(context))


@router.get(
    "/{view}/{exposure}.png",
    response_class=Response,
    responses={**responses(404), 200: {"content": {"image/png": {}}}},
)
def show_pixels(
    view: Annotated[ViewName, Path(description="name of a view")],
    exposure: Annotated[ExposureName, Path(description="first or second exposure")],
    context: ContextOf,
    row: Annotated[int, Query(ge=0, le=65_535, description="of the middle of a part")] = 0,
    column: Annotated[int, Query(ge=0, le=65_535, description="of the middle of a part")] = 0,
    size_px: Annotated[int | None, Query(ge=2, le=512, description="edge of a part; without it, the frame")] = None,
    scale: Annotated[Stretch, Query(description="full: grey values as they are; auto: stretched")] = Stretch.FULL,
) -> Response:
    """The newest shot of a view, pixel by pixel, or a square part of it; beyond the edge of the frame it is black."""
    image = context.live.image(view, exposure)
    part = image if size_px is None else square_at(image, row, column, size_px)
    bits = context.services.rig.cameras[view].bits
    return Response(frame_png(part, bits, scale), media_type="image/png", headers={"Cache-Control": "no-store"})
