"""Timing of a shot as it was asked for and as it is fired, side by side. Pure; zero is the start of light pulse A."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from daq.drivers.camera_profile import load_camera_profile
from daq.errors import PlanError
from daq.run.shots.train_check import lit_pulses
from daq.run_plan import PulsePair, RunPlan
from daq.shot import FiredTrain, LightPulse
from daq.timing import CameraTiming, ShotTiming, ViewTiming, Window
from server.rig.config import ConfigError, RigConfig


@dataclass(frozen=True)
class Guards:
    """Distances that the light of one view keeps from the frame boundary.

    Parameters
    ----------
    before_ns : int
        End of pulse A to the end of exposure A.
    after_ns : int
        Start of exposure B to the start of pulse B.
    """

    before_ns: int
    after_ns: int


def guards_of(view: ViewTiming) -> Guards:
    """Distances of both pulses from the frame boundary."""
    return Guards(view.frame_a.close_ns - view.pulse_a.close_ns, view.pulse_b.open_ns - view.frame_b.open_ns)


def camera_timings(config: RigConfig) -> dict[str, CameraTiming]:
    """Timing model of every view's camera; PlanError if a profile cannot be read."""
    return {name: load_camera_profile(view.camera.profile).camera_timing for name, view in config.views.items()}


def nominal_plan(config: RigConfig, width_ns: int | None = None, separation_ns: int | None = None) -> RunPlan:
    """Plan of one shot at the nominal currents of a rig; where not given, width and separation of a new plan.

    Raises
    ------
    PlanError
        No plan allows such pulses.
    """
    given = {"width_ns": width_ns, "separation_ns": separation_ns}
    currents_a = {name: view.nominal_current_a for name, view in config.views.items()}
    pulses = {"current_a": currents_a, **{name: value for name, value in given.items() if value is not None}}
    try:
        pulse = PulsePair.model_validate(pulses)
    except ValidationError as error:
        problems = (f"pulse.{problem['loc'][-1]}: {problem['input']}: {problem['msg']}" for problem in error.errors())
        raise PlanError("; ".join(problems)) from error
    return RunPlan(name="nominal", shots=1, pulse=pulse)


def load_plan(path: Path) -> RunPlan:
    """Read a run plan from JSON, as the API takes it; ConfigError if it is none."""
    try:
        return RunPlan.model_validate_json(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: {error}") from error


def fired_timing(requested: ShotTiming, cameras: Mapping[str, CameraTiming], train: FiredTrain) -> ShotTiming:
    """Timing that the generator's train really gives; exposures follow the actual camera triggers.

    A view without light keeps the pulses that were asked for, at 0 A.
    """
    origin_ns = _origin_ns(requested, train)
    views = {
        name: _fired_view(
            view, cameras[name], train.camera_trigger_ns[name] - origin_ns, train.pulses.get(name, ()), origin_ns
        )
        for name, view in requested.views.items()
    }
    return replace(requested, views=views)


def _origin_ns(requested: ShotTiming, train: FiredTrain) -> int:
    """Where the train, which counts from its trigger, has the zero of the request."""
    for pulses in train.pulses.values():
        if lit := lit_pulses(pulses):
            return lit[0].start_ns
    view = next(iter(requested.views))
    return train.camera_trigger_ns[view] - requested.views[view].camera_trigger_ns


def _fired_view(
    requested: ViewTiming, camera: CameraTiming, trigger_ns: int, pulses: tuple[LightPulse, ...], origin_ns: int
) -> ViewTiming:
    frame_a, frame_b = camera.exposures(trigger_ns)
    exposed = replace(requested, camera_trigger_ns=trigger_ns, frame_a=frame_a, frame_b=frame_b)
    lit = lit_pulses(pulses)
    if len(lit) != 2:
        return replace(exposed, current_a=0.0)
    pulse_a, pulse_b = (
        Window(pulse.start_ns - origin_ns, pulse.start_ns + pulse.width_ns - origin_ns) for pulse in lit
    )
    return replace(exposed, pulse_a=pulse_a, pulse_b=pulse_b, current_a=lit[0].current_a)


def timing_table(requested: ShotTiming, actual: ShotTiming) -> dict[str, Any]:
    """Edges in ns and currents in ampere by view, as asked for and as fired."""
    return {
        name: {"requested": _edges(view), "actual": _edges(actual.views[name])}
        for name, view in requested.views.items()
    }


def _edges(view: ViewTiming) -> dict[str, Any]:
    guards = guards_of(view)
    return {
        "camera_trigger_ns": view.camera_trigger_ns,
        "frame_a_ns": [view.frame_a.open_ns, view.frame_a.close_ns],
        "frame_b_ns": [view.frame_b.open_ns, view.frame_b.close_ns],
        "pulse_a_ns": [view.pulse_a.open_ns, view.pulse_a.close_ns],
        "pulse_b_ns": [view.pulse_b.open_ns, view.pulse_b.close_ns],
        "separation_ns": view.pulse_b.open_ns - view.pulse_a.open_ns,
        "gap_ns": view.frame_b.open_ns - view.frame_a.close_ns,
        "guard_before_ns": guards.before_ns,
        "guard_after_ns": guards.after_ns,
        "current_a": view.current_a,
    }
