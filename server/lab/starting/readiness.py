"""Readiness: what speaks against a start. ``run_start`` raises the first refusal, the desk shows all of them."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict
from itertools import chain
from pathlib import Path

from daq.errors import DaqError, DeviceUnavailable, ShotFileError
from daq.run.references import exchanged_cameras
from daq.run.refusals import RefusalCode, coded
from daq.run_plan import RunKind, RunPlan
from server.lab.calibration_story import misfits
from server.lab.desk.control import REMEDIES
from server.lab.desk.reason import DeskCode, Reason, Refusal, reason_of
from server.lab.desk.visitor import Visitor
from server.lab.duty import Health
from server.lab.errors import Damaged, Forbidden, Locked, NotFound, ServerError, Unprocessable
from server.lab.recipes.stated import against_recipes, usual_recipe, with_recipes
from server.lab.services import Context


def reasons_against(context: Context, plan: RunPlan | None = None) -> tuple[Reason, ...]:
    """Everything that speaks against starting a run, or this one, now; the first is the one that a start would name.

    Devices are asked, so that it may take a second where one is silent; the light stays as it is.
    """
    others = None
    if plan is not None:
        plan = with_defaults(context, plan)
        others = plan.model_copy(update={"calibration": None})  # the laboratory has read it: one reason is enough
    refusals = chain(refusals_of_lab(context, plan), context.services.acquisition.refusals(others))
    return tuple(map(reason_of, refusals))


def reasons_against_visitor(context: Context, who: Visitor) -> tuple[Reason, ...]:
    """Why this person may not start anything now; a start is refused for it before anything else is looked at."""
    try:
        context.control.check(who)
    except (Forbidden, Locked) as error:
        code: DeskCode = "viewer" if isinstance(error, Forbidden) else "control_held"
        return (Reason(code=code, text=str(error), remedy=REMEDIES[code]),)
    return ()


def refusals_of_lab(context: Context, plan: RunPlan | None) -> Iterator[Refusal]:
    """What the laboratory has against a start; acquisition is asked after it."""
    if not context.services.acquisition.status().active:
        yield from _silent_cameras(context)
    if plan is None:
        return
    yield from _against_cameras(context, plan)
    if plan.calibration is not None:
        yield from _against_calibration(context, plan.calibration)
    yield from against_recipes(context.runs, plan, _calibration_file(context, plan))


def with_defaults(context: Context, plan: RunPlan) -> RunPlan:
    """A sample run that does not say them gets current calibration and usual recipe, so that they travel with it."""
    plan = _with_calibration(context, plan)
    return with_recipes(plan, usual_recipe(context.services.settings), _calibration_file(context, plan))


def _with_calibration(context: Context, plan: RunPlan) -> RunPlan:
    if plan.calibration is not None or plan.kind is not RunKind.SAMPLE:
        return plan
    return plan.model_copy(update={"calibration": context.calibrations.current})


def _calibration_file(context: Context, plan: RunPlan) -> Path | None:
    """Whether it exists or not; None where that is no name."""
    with suppress(NotFound):
        return context.calibrations.path(plan.calibration or "")
    return None


def _silent_cameras(context: Context) -> Iterator[DaqError]:
    """A run without one of its cameras would fail at once."""
    for lamp in context.monitor.lamps:
        if lamp.kind == "camera" and lamp.health is Health.FAULT:
            reason = lamp.trouble.removeprefix(f"{lamp.name}: ")
            yield coded(DeviceUnavailable(lamp.name, reason), RefusalCode.CAMERA_SILENT)


def _against_cameras(context: Context, plan: RunPlan) -> Iterator[ServerError]:
    """Another camera has other pixels than the references; asked of what the cameras have told, not of them."""
    devices = {name: asdict(identity) for name, identity in context.monitor.identities.items()}
    chosen = (context.runs.directory(run_id) for run_id in plan.references if context.runs.has(run_id))
    with suppress(ShotFileError):  # acquisition says so
        for view, difference in exchanged_cameras(chosen, devices).items():
            yield Unprocessable(f"references: {view}: {difference}", RefusalCode.REFERENCE_CAMERA)


def _against_calibration(context: Context, calibration: str) -> Iterator[ServerError]:
    """A camera that is binned, or another one, needs another calibration; later nothing could be reconstructed."""
    try:
        context.calibrations.document(calibration)
    except NotFound as error:
        yield Unprocessable(f"calibration: {error}", RefusalCode.CALIBRATION_UNKNOWN)
        return
    except Damaged as error:
        yield Unprocessable(f"calibration: {error}", RefusalCode.CALIBRATION_DAMAGED)
        return
    if found := misfits(context, calibration):
        yield Unprocessable(f"calibration: {'; '.join(found)}", RefusalCode.CALIBRATION_SIZE)
