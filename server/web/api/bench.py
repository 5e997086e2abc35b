"""/api/bench: the laboratory of a simulated rig, where doors open and things go wrong. A real rig answers 404."""

from typing import Annotated

from fastapi import APIRouter
from pydantic import Field

from daq.faults import Fault
from daq.frozen_model import FrozenModel
from server.lab.errors import NotFound, Unprocessable
from server.rig.laboratory import Laboratory
from server.web.api.parameters import ContextOf
from server.web.problems import responses

router = APIRouter(prefix="/api/bench", tags=["bench"])


class Door(FrozenModel):
    """The laboratory door; open, it locks the light."""

    open: Annotated[bool, Field(description="true: open")]


@router.post("/faults", status_code=202, responses=responses(404))
def inject_fault(fault: Fault, context: ContextOf) -> Fault:
    """Let something go wrong, from now on or at the next shot."""
    try:
        _laboratory(context).inject(fault)
    except ValueError as error:
        raise Unprocessable(str(error)) from error
    return fault


@router.put("/door", responses=responses(404))
def move_door(door: Door, context: ContextOf) -> Door:
    """Open or close the laboratory door."""
    laboratory = _laboratory(context)
    if door.open:
        laboratory.open_door()
    else:
        laboratory.close_door()
    return door


def _laboratory(context: ContextOf) -> Laboratory:
    if context.services.laboratory is None:
        raise NotFound("this rig is no simulated bench")
    return context.services.laboratory
