"""/api/rig/control: who of several people makes light, moves and changes; ABORT and stop never ask for it."""

from typing import Annotated

from fastapi import APIRouter
from pydantic import Field

from daq.frozen_model import FrozenModel
from server.lab.desk.visitor import Role, Visitor
from server.lab.services import Context
from server.web.api.parameters import ContextOf, Who
from server.web.problems import responses

router = APIRouter(prefix="/api/rig/control", tags=["rig"])


class ControlView(FrozenModel):
    """Who holds control."""

    holder: Annotated[str | None, Field(description="name; null: nobody, and the next who acts holds it")]
    left_s: Annotated[
        float | None, Field(description="until it is free, if its holder does nothing; a run or live view keeps it")
    ]
    mine: Annotated[bool, Field(description="true: held by who asks")]
    you: Annotated[str, Field(description="name of who asks")]
    role: Annotated[Role, Field(description="of who asks: a viewer looks and aborts")]


@router.get("")
async def show_control(context: ContextOf, who: Who) -> ControlView:
    """Who holds control, and who asks."""
    return _view(context, who)


@router.put("", responses=responses(403))
async def take_control(context: ContextOf, who: Who) -> ControlView:
    """Take it, from whoever holds it, who is told. A script has to say who runs it: header Tomoshadow-Operator."""
    context.control.take(who)
    return _view(context, who)


@router.delete("")
async def give_control_back(context: ContextOf, who: Who) -> ControlView:
    """Give it back; where somebody else holds it, nothing happens."""
    context.control.release(who)
    return _view(context, who)


def _view(context: Context, who: Visitor) -> ControlView:
    holder = context.control.holder
    is_mine = holder is not None and holder.who.id == who.id
    name, left_s = (holder.who.name, holder.left_s) if holder else (None, None)
    return ControlView(holder=name, left_s=left_s, mine=is_mine, you=who.name, role=who.role)
