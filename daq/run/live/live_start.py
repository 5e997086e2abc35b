"""What a live view starts from: a plan that the rig permits, and somebody who looks."""

import time
from collections.abc import Mapping

from daq.devices import Rig
from daq.run import light
from daq.run.preflight import permitted_timing
from daq.run_plan import LivePlan, PulsePair, RunKind, RunPlan
from daq.timing import CameraTiming, ShotTiming

SHOTS_PER_ARMING = 1000
"""The generator gets so many shots at once, and then the next ones: it never has leave for hours."""


class Audience:
    """When somebody last looked at the live view; any thread."""

    def __init__(self) -> None:
        self._looked_s = time.monotonic()

    def look(self) -> None:
        """Somebody looks now."""
        self._looked_s = time.monotonic()

    @property
    def absent_s(self) -> float:
        """Time since."""
        return time.monotonic() - self._looked_s


def checked_plan(rig: Rig, live: LivePlan) -> tuple[RunPlan, ShotTiming]:
    """Plan and edges of the shots of a live view, found to be possible.

    Raises
    ------
    PlanError
        The rig does not permit its light or its rate; the text names value and limit.
    DeviceRefused
        The pulse generator has a latched fault.
    InterlockOpen
        The light must not be switched on. Without it the generator does not trigger the cameras either.
    """
    cameras = {view: camera.timing for view, camera in rig.cameras.items()}
    kind = RunKind.SAMPLE if live.pulse else RunKind.DARK
    pulse = live.pulse or _no_light(cameras)
    plan = RunPlan(name="live", kind=kind, shots=SHOTS_PER_ARMING, rate_hz=live.rate_hz, pulse=pulse, refire_quota=0)
    timing = permitted_timing(rig, plan)
    light.check_permitted(rig)
    return plan, timing


def _no_light(cameras: Mapping[str, CameraTiming]) -> PulsePair:
    """No current, at any separation that every camera permits: edges are placed all the same."""
    pulse = PulsePair(current_a=dict.fromkeys(cameras, 0.0))
    shortest_ns = max(camera.straddling_ns(pulse.width_ns)[0] for camera in cameras.values())
    return pulse.model_copy(update={"separation_ns": max(pulse.separation_ns, shortest_ns)})
