"""/api/rig/readiness: the state of the whole rig, and everything that speaks against a start, asked now."""

from typing import Annotated

from fastapi import APIRouter
from pydantic import Field

from daq.frozen_model import FrozenModel
from daq.run_plan import RunPlan
from server.lab.desk.reason import Reason
from server.lab.desk.rig_state import RigState
from server.lab.starting.preflight_list import Check, check_control, checks_of
from server.lab.starting.readiness import reasons_against, reasons_against_visitor
from server.web.api.parameters import ContextOf, Who

router = APIRouter(prefix="/api/rig/readiness", tags=["rig"])


class PlanReadiness(FrozenModel):
    """Whether a plan would be started now."""

    ready: Annotated[bool, Field(description="true: a start of this plan would not be refused")]
    reasons: Annotated[
        tuple[Reason, ...], Field(description="everything against it; a start names the first one; empty: nothing")
    ]
    checks: Annotated[tuple[Check, ...], Field(description="everything that was looked at, with figures")]


@router.get("")
def show_readiness(context: ContextOf) -> RigState:
    """State of the rig in one word. Interlock and generator are asked now; cameras are once a second."""
    return context.desk.look()


@router.post("")
def judge_plan(plan: RunPlan, context: ContextOf, who: Who) -> PlanReadiness:
    """What speaks against starting this plan now, without starting it."""
    of_plan = reasons_against(context, plan)
    reasons = (*reasons_against_visitor(context, who), *of_plan)
    checks = (check_control(context, who), *checks_of(context, plan, of_plan))
    return PlanReadiness(ready=not reasons, reasons=reasons, checks=checks)
