"""/api/rig/alarms: what is wrong, one by one."""

from typing import Annotated

from fastapi import APIRouter, Path

from server.lab.desk.alarms import Alarm
from server.lab.starting.alarms_now import acknowledge
from server.lab.starting.command import tell_deed
from server.web.api.parameters import ContextOf, Who
from server.web.problems import responses

router = APIRouter(prefix="/api/rig/alarms", tags=["rig"])


@router.get("")
async def list_alarms(context: ContextOf) -> tuple[Alarm, ...]:
    """One per cause, with its remedy; looked for twice a second."""
    return context.desk.alarms


@router.post("/{alarm_id}/acknowledge", status_code=202, responses=responses(404, 409, 423, 503, 504))
def acknowledge_alarm(
    alarm_id: Annotated[str, Path(pattern="^[0-9a-f]{16}$", description="of one alarm")], context: ContextOf, who: Who
) -> tuple[Alarm, ...]:
    """An operator has seen this alarm, and no other one. A latched fault is cleared."""
    acknowledge(context, alarm_id)
    tell_deed(context, who, "acknowledged an alarm")
    return context.desk.alarms
