"""Pre-flight: everything that is looked at before a run, one line each, with figures where nothing is wrong."""

import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from itertools import chain
from typing import Annotated

from pydantic import Field

from daq.counted import counted
from daq.files.header import ViewFormat
from daq.frozen_model import FrozenModel
from daq.run.preflight import FRAMES_PER_SHOT
from daq.run.references import REFERENCE_KINDS
from daq.run.refusals import RefusalCode as Code
from daq.run.state import RunState
from daq.run_plan import RunKind, RunPlan
from processing.calibration.verdict import Verdict
from server.lab.calibration_story import story_of
from server.lab.desk.reason import UNSEEN, Reason
from server.lab.desk.visitor import Visitor
from server.lab.errors import Damaged, NotFound
from server.lab.recipes.stated import told_recipes
from server.lab.services import Context
from server.lab.starting.readiness import reasons_against_visitor, with_defaults

CODES: Mapping[str, tuple[Code, ...]] = {
    "Rig": (Code.STARTING, Code.BUSY, Code.LIGHT_NOT_OFF, Code.PROGRAM_ENDING, Code.NOT_ACKNOWLEDGED),
    "Interlock": (Code.INTERLOCK_OPEN, Code.INTERLOCK_SILENT, Code.ESTOP_OPEN),
    "Pulse generator": (Code.GENERATOR_FAULT, Code.GENERATOR_SILENT),
    "Cameras": (Code.CAMERA_SILENT,),
    "Light": (Code.CURRENT,),
    "Timing": (Code.TIMING,),
    "Network": (Code.NETWORK,),
    "Disk": (Code.FOLDER_GONE, Code.STORAGE, Code.DISK_FULL),
    "Stage": (Code.STAGE,),
    "References": (Code.REFERENCES, Code.REFERENCE_CAMERA),
    "Calibration": (Code.CALIBRATION_UNKNOWN, Code.CALIBRATION_DAMAGED, Code.CALIBRATION_SIZE),
    "Recipe": (Code.RECIPE,),
}
"""Every refusal has one place."""
OF_THE_RIG: frozenset[str] = frozenset(
    chain(*(CODES[name] for name in ("Rig", "Interlock", "Pulse generator", "Cameras")), (UNSEEN.code,))
)
"""No form changes anything about these."""


class CheckResult(StrEnum):
    """What came of a look."""

    GOOD = "good"
    WARN = "warn"
    WAIT = "wait"
    REFUSED = "refused"


class Check(FrozenModel):
    """One thing that was looked at."""

    name: Annotated[str, Field(description="what was looked at")]
    finding: Annotated[
        CheckResult,
        Field(description="refused: a start would be, for this reason; wait: it would, until what goes on has ended"),
    ]
    text: Annotated[str, Field(description="what was found, with figures")]
    remedy: Annotated[str, Field(description="what to do about it; empty: nothing")] = ""


PASSING = frozenset({Code.STARTING, Code.BUSY})
"""Nothing is wrong: they end by themselves."""

Told = tuple[str, str]
"""Text, and remedy of a warning; an empty remedy: nothing is wrong."""


def checks_of(context: Context, plan: RunPlan, reasons: Sequence[Reason]) -> tuple[Check, ...]:
    """Everything that could speak against a plan, where ``reasons_against`` has found these reasons."""
    plan = with_defaults(context, plan)
    checks = []
    for name, tell in _ROWS.items():
        against = [reason for reason in reasons if reason.code in CODES[name]]
        if against:
            checks.append(_refused(name, against))
        elif told := tell(context, plan):
            text, remedy = told
            checks.append(
                Check(name=name, finding=CheckResult.WARN if remedy else CheckResult.GOOD, text=text, remedy=remedy)
            )
    return tuple(checks)


def check_control(context: Context, who: Visitor) -> Check:
    """Whether this person may start."""
    for reason in reasons_against_visitor(context, who):
        return Check(name="Control", finding=CheckResult.REFUSED, text=reason.text, remedy=reason.remedy)
    held = context.control.holder is not None
    return Check(name="Control", finding=CheckResult.GOOD, text="yours" if held else "free: a start takes it")


def _refused(name: str, reasons: list[Reason]) -> Check:
    text, remedies = "; ".join(reason.text for reason in reasons), dict.fromkeys(reason.remedy for reason in reasons)
    finding = CheckResult.WAIT if all(reason.code in PASSING for reason in reasons) else CheckResult.REFUSED
    return Check(name=name, finding=finding, text=text, remedy="; ".join(remedies))


def _light(context: Context, plan: RunPlan) -> Told:
    limits = context.services.rig.max_current_a
    currents = plan.pulse.current_a
    if plan.kind is RunKind.DARK:
        return "none: this is a dark run", ""
    view = max(currents, key=lambda view: currents[view] / limits.get(view, 30), default=None)
    if view is None:
        return "no view has a current", "give a current"
    return f"at most {currents[view]:g} A, of {limits.get(view, 30):g} A that {view} may have", ""


def _timing(_context: Context, plan: RunPlan) -> Told:
    pulse = plan.pulse
    return f"pulses of {pulse.width_ns} ns, {pulse.separation_ns} ns apart, at {plan.rate_hz:g} Hz", ""


def _network(context: Context, plan: RunPlan) -> Told:
    rig = context.services.rig
    shot_s = rig.network.shot_s({view: FRAMES_PER_SHOT * size for view, size in _frame_bytes(context).items()})
    return f"{percent(shot_s * plan.rate_hz)} of the wires: a shot takes {1e3 * shot_s:.0f} ms", ""


def percent(share: float) -> str:
    """A share in percent; a small one is not nothing."""
    return "less than 1 %" if 0 < share < 0.01 else f"{100 * share:.0f} %"


def _disk(context: Context, plan: RunPlan) -> Told:
    needed = plan.total_shots * FRAMES_PER_SHOT * sum(_frame_bytes(context).values())
    free = shutil.disk_usage(context.services.data_dir).free
    took = _duration(plan.total_shots / plan.rate_hz)
    return f"{_gigabytes(needed)} of {_gigabytes(free)} free; {took} at {plan.rate_hz:g} Hz", ""


def _stage(_context: Context, plan: RunPlan) -> Told | None:
    z_mm = plan.stage_z_mm
    return (f"{counted(len(z_mm), 'position')}, {min(z_mm):g} to {max(z_mm):g} mm", "") if z_mm else None


def _references(context: Context, plan: RunPlan) -> Told | None:
    if plan.kind is not RunKind.SAMPLE:
        return None
    kinds = {run_id: _kind_of(context, run_id) for run_id in plan.references}
    newest = {kind: run.run_id for kind in REFERENCE_KINDS for run in context.runs.references(kind)}
    newer = [
        f"a newer {kind} exists: {run_id}"
        for kind, run_id in newest.items()
        if kind in kinds.values() and run_id not in kinds
    ]
    absent = [f"no {kind} run" for kind in REFERENCE_KINDS if kind not in kinds.values()]
    if absent or newer:
        remedy = "choose it, or go on with what is chosen" if newer else "record what lacks, or choose it in the form"
        return ", ".join([*absent, *newer]), remedy
    return f"{', '.join(REFERENCE_KINDS)} fit this light", ""


def _kind_of(context: Context, run_id: str) -> RunKind | None:
    """What a run was prepared for; None where it was deleted meanwhile."""
    try:
        return context.runs.summary(run_id).kind
    except NotFound:
        return None


def _calibration(context: Context, plan: RunPlan) -> Told | None:
    if plan.kind is not RunKind.SAMPLE:
        return None
    if plan.calibration is None:
        return "none: no volumes will be made", "calibrate, or choose one on the page Calibrate"
    standing = context.standing
    if standing is not None and standing.calibration == plan.calibration and standing.is_alarm:
        return f"{plan.calibration}: {standing.message}", "calibrate again"
    if doubt := _doubt(context, plan.calibration):
        return f"{plan.calibration}: {doubt}", "calibrate again"
    made_s = context.calibrations.made_s(plan.calibration)
    age = "" if made_s is None else f", {_duration(time.time() - made_s)} old"
    return f"{plan.calibration}{age}; fits the images of this rig", ""


def _doubt(context: Context, calibration_id: str) -> str:
    """What a calibration says against itself; empty where it is good, or says nothing that can be read."""
    try:
        story = story_of(context, calibration_id)
    except (NotFound, Damaged):
        return ""
    return f"{story.verdict}: {story.remedy}" if story.verdict in (Verdict.WARN, Verdict.REFUSE) else ""


def _recipe(_context: Context, plan: RunPlan) -> Told | None:
    if plan.kind is not RunKind.SAMPLE:
        return None
    if plan.recipes and not plan.calibration:
        return "nothing is made without a calibration", ""
    return told_recipes(plan.recipes or ()), ""


def _always(text: str) -> Callable[[Context, RunPlan], Told]:
    return lambda _context, _plan: (text, "")


def _rig(context: Context, _plan: RunPlan) -> Told:
    is_live = context.services.acquisition.status().state is RunState.LIVE
    return "a live view goes on: a start ends it" if is_live else "at rest", ""


def _cameras(context: Context, _plan: RunPlan) -> Told:
    return f"{len(context.services.rig.cameras)} answer", ""


_ROWS: Mapping[str, Callable[[Context, RunPlan], Told | None]] = {
    "Rig": _rig,
    "Interlock": _always("closed"),
    "Pulse generator": _always("answers, without a fault"),
    "Cameras": _cameras,
    "Light": _light,
    "Timing": _timing,
    "Network": _network,
    "Disk": _disk,
    "Stage": _stage,
    "References": _references,
    "Calibration": _calibration,
    "Recipe": _recipe,
}


def _frame_bytes(context: Context) -> dict[str, int]:
    cameras = context.services.rig.cameras
    formats = {view: ViewFormat(camera.image_shape, camera.bits) for view, camera in cameras.items()}
    return {view: one.frame_bytes for view, one in formats.items()}


def _gigabytes(count: float) -> str:
    if count < 1e8:
        return f"{count / 1e6:.2g} MB"
    return f"{count / 1e9:.0f} GB" if count >= 1e10 else f"{count / 1e9:.2g} GB"


def _duration(time_s: float) -> str:
    """A time in a unit in which it is two or more."""
    for unit_s, unit in ((86_400, "d"), (3600, "h"), (60, "min")):
        if time_s >= 2 * unit_s:
            return f"{time_s / unit_s:.1f} {unit}"
    return f"{max(0.0, time_s):.0f} s"
