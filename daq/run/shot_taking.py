"""ShotTaker: pace, fire, collect, check; and fire again where a frame is proven to be missing."""

import time

from daq.errors import DeviceRefused
from daq.run import light
from daq.run.active_run import ActiveRun
from daq.run.shot_check import ShotFindings, Thresholds, check_exposures
from daq.run.train_check import train_deviation
from daq.run_plan import ImageKey
from daq.shot import DoubleFrame, FiredTrain, Shot

_LEAST_COLLECT_S = 0.05
"""What a camera gets although another one used up the deadline: its frames lie in its buffers already."""

_LATE_PERIODS = 0.5
"""A shot that is later by so many periods moves those after it, and none comes closer to the one before."""


def next_due_s(due_s: float, fired_s: tuple[float, float], period_s: float, shortest_s: float) -> float:
    """When the next shot is due.

    A shot that is a little late does not move those after it, so that the period is exact; one that is late by more
    than half a period does: nothing is caught up, and no two shots are closer than half a period. Cameras and generator
    refuse, or, worse, ignore an early trigger: the shortest period counts from when the last one has surely been.

    Parameters
    ----------
    due_s : float
        When the last shot was due.
    fired_s : tuple[float, float]
        When it was commanded, and when it was confirmed.
    period_s, shortest_s : float
        As asked for, and as the rig permits.
    """
    commanded_s, confirmed_s = fired_s
    kept_s = due_s if commanded_s - due_s <= _LATE_PERIODS * period_s else commanded_s
    return max(kept_s + period_s, confirmed_s + max(shortest_s, _LATE_PERIODS * period_s))


class ShotTaker:
    """Takes the shots of one run on armed cameras.

    Parameters
    ----------
    run : ActiveRun
        What to do; its ending is looked at before every shot, while waiting for its time, and between cameras.
    thresholds : Mapping[str, tuple[float, float]]
        Bright levels above which an exposure is lit.
    """

    def __init__(self, run: ActiveRun, thresholds: Thresholds) -> None:
        self._rig = run.rig
        self._plan = run.prepared.plan
        self._timing = run.prepared.timing
        self._ending = run.ending
        self._say = run.progress.say
        self._thresholds = thresholds
        self._frame_deadline_s = self._timing.shortest_period_ns / 1e9 + run.limits.frame_s
        self._refires_left = self._plan.refire_quota
        self._period_s = 1 / self._plan.rate_hz
        self._shortest_s = self._timing.shortest_period_ns / 1e9
        self._due_s = 0.0
        self._stage_z_mm: float | None = None

    def load_position(self, position: int) -> None:
        """Move the stage in the dark, load the pulse train, verify its echo, arm the generator for these shots.

        Raises
        ------
        DeviceRefused
            The generator did not load what it was asked to.
        """
        generator, plan = self._rig.generator, self._plan
        if plan.stage_z_mm and self._rig.stage:
            light.switch_off(self._rig)
            self._stage_z_mm = self._rig.stage.move_to(plan.stage_z_mm[position])
        if deviation := train_deviation(self._timing, generator.configure(self._timing)):
            raise DeviceRefused(generator.name, f"loaded another pulse train: {deviation}")
        if not self._ending.step:
            period_us = generator.arm(plan.shots + self._refires_left, period_us=int(1e6 * self._period_s))
            self._shortest_s = max(self._timing.shortest_period_ns / 1e9, period_us / 1e6)

    def take(self, index: int) -> Shot | None:
        """Take one shot when it is due; None if the run is ended."""
        position, number = divmod(index, self._plan.shots)
        if position and not number:
            self.load_position(position)
        while self._ending.wait_until(self._due_s):
            shot, findings = self._fire(index)
            if shot is None or not findings.missing or not self._refires_left:
                return shot
            self._refires_left -= 1
            self._say(f"shot {index} is fired again, {self._refires_left} more permitted")
        return None

    def _fire(self, index: int) -> tuple[Shot | None, ShotFindings]:
        """Fire and look at what came of it."""
        for camera in self._rig.cameras.values():
            camera.begin_shot()
        host_time_ns = time.time_ns()
        sent_s = time.monotonic()
        fired = self._rig.generator.fire()
        self._due_s = next_due_s(self._due_s, (sent_s, time.monotonic()), self._period_s, self._shortest_s)
        views = self._collect()
        if views is None:
            return None, ShotFindings()
        findings = self._check(index, fired, views)
        key = self._plan.kind.image_key if findings.good else ImageKey.INVALID
        return Shot(index, key, views, fired, host_time_ns, self._stage_z_mm), findings

    def _collect(self) -> dict[str, DoubleFrame] | None:
        """Collect the exposures of all views before one common deadline; None if the run ends at once."""
        deadline_s = time.monotonic() + self._frame_deadline_s
        views = {}
        for view, camera in self._rig.cameras.items():
            views[view] = camera.collect(max(_LEAST_COLLECT_S, deadline_s - time.monotonic()))
            if self._ending.at_once:
                return None
        return views

    def _check(self, index: int, fired: FiredTrain, views: dict[str, DoubleFrame]) -> ShotFindings:
        lit = {view: one.current_a > 0 for view, one in self._timing.views.items()}
        misfired = train_deviation(self._timing, fired) or ""
        findings = check_exposures(views, lit, self._thresholds, misfired)
        if not findings.good:
            self._say(f"shot {index}: {findings}")
        return findings
