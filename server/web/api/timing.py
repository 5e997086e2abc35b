"""Timing diagrams: of the pulses that a new run would ask for, and of those that a run has fired."""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Response

from daq.run_plan import RunPlan
from daq.shot import FiredTrain
from daq.timing import CameraTiming, ShotTiming, plan_shot_timing
from server.lab.errors import Conflict, NotFound
from server.lab.services import Context
from server.rig.shot_timing import fired_timing, nominal_plan
from server.web.api.parameters import ContextOf, RunId
from server.web.problems import responses

router = APIRouter(prefix="/api", tags=["timing"])

_SVG: dict[int | str, dict[str, Any]] = {200: {"content": {"image/svg+xml": {}}}}


@router.get("/rig/timing.svg", response_class=Response, responses={**responses(422), **_SVG})
def draw_rig_timing(
    context: ContextOf,
    width_ns: Annotated[int | None, Query(description="pulse width; default: that of a new plan")] = None,
    separation_ns: Annotated[int | None, Query(description="pulse separation; default: that of a new plan")] = None,
) -> Response:
    """Camera triggers, exposures and pulses of one shot at the nominal currents, as a run would ask for them."""
    config = context.services.config
    timing = plan_shot_timing(nominal_plan(config, width_ns, separation_ns), _cameras(context))
    return _drawing(timing, f"{config.name}: one shot as asked for")


@router.get("/runs/{run_id}/timing.svg", response_class=Response, responses={**responses(404, 409), **_SVG})
def draw_run_timing(run_id: RunId, context: ContextOf) -> Response:
    """First shot of a run as it was fired, edges as the generator has quantised them, on the cameras of this rig."""
    plan, train = _fired(run_id, context)
    cameras = _cameras(context)
    if set(train.camera_trigger_ns) != set(cameras):
        views = sorted(train.camera_trigger_ns)
        raise Conflict(f"run {run_id} has views {views}, this rig {sorted(cameras)}: its exposures are not known")
    timing = fired_timing(plan_shot_timing(plan, cameras), cameras, train)
    return _drawing(timing, f"{run_id}: first shot as fired")


def _cameras(context: Context) -> dict[str, CameraTiming]:
    return {name: camera.timing for name, camera in context.services.rig.cameras.items()}


def _fired(run_id: str, context: Context) -> tuple[RunPlan, FiredTrain]:
    with context.runs.reader(run_id) as run:
        shot = run.read_shot(0) if run.shot_count else None
        plan = run.header.plan
    if plan is None or shot is None or shot.fired is None:
        raise NotFound(f"run {run_id} has no shot that was fired here")
    return plan, shot.fired


def _drawing(timing: ShotTiming, title: str) -> Response:
    from server.pictures.timing_diagram import picture, timing_diagram  # loads matplotlib

    return Response(picture(timing_diagram(timing, title), "svg"), media_type="image/svg+xml")
