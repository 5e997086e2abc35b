"""ShotTaker: pace, fire, collect, check; and fire again where a frame is proven to be missing.

The acquisition thread controls the light, so it waits for no register of a camera while the generator is armed: a
camera of which nothing comes in time costs the light first, then it is asked, and then the generator is armed again.
"""

import time

from daq.devices import Camera
from daq.errors import DeviceRefused
from daq.run import light
from daq.run.shooting import Shooting
from daq.run.shots.firing_clock import FiringClock
from daq.run.shots.shot_check import ShotFindings, Thresholds, check_exposures, marked
from daq.run.shots.train_check import train_deviation
from daq.run.side_by_side import SideBySide
from daq.run_plan import ImageKey
from daq.shot import DoubleFrame, FiredTrain, Shot

_SLICE_S = 0.02
"""How often is looked whether something ends a shot whose frames have not all come."""

_ANSWER_LIMIT_S = 2.0
"""For cameras of which nothing came, in the dark; each gives up on the answer itself before."""

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
    """Takes the shots of one run, or of a live view, on armed cameras.

    Parameters
    ----------
    run : Shooting
        What to do; its ending is looked at before every shot, while waiting for its time, and between cameras.
    thresholds : Mapping[str, tuple[float, float]]
        Bright levels above which an exposure is lit.
    """

    def __init__(self, run: Shooting, thresholds: Thresholds) -> None:
        self._rig = run.rig
        self._plan = run.plan
        self._timing = run.timing
        self._ending = run.ending
        self._say = run.say
        self._wait_for = run.progress.wait_for
        self._thresholds = thresholds
        self._frame_deadline_s = round(self._timing.shortest_period_ns / 1e9 + run.limits.frame_s, 2)
        self._patience_s = run.limits.patience_s
        self._refires_left = self._plan.refire_quota
        self._period_s = 1 / self._plan.rate_hz
        self._shortest_s = self._timing.shortest_period_ns / 1e9
        self._due_s = 0.0
        self._armed = False
        self._clock = FiringClock()
        self._stage_z_mm: float | None = None
        self.last_fired: int | None = None
        """Index of the shot that was fired last, whatever became of it."""

    def load_position(self, position: int) -> None:
        """Move the stage in the dark, load the pulse train, verify its echo, arm the generator for these shots.

        Raises
        ------
        DeviceRefused
            The generator did not load what it was asked to.
        """
        if self._plan.stage_z_mm and self._rig.stage:
            self._darken()
            z_mm = self._plan.stage_z_mm[position]
            self._wait_for(f"{self._rig.stage.name}: to be at {z_mm:g} mm")
            self._stage_z_mm = self._rig.stage.move_to(z_mm)
        self._arm(self._plan.shots)

    def take(self, index: int) -> Shot | None:
        """Take one shot when it is due; None if the run is ended."""
        position, number = divmod(index, self._plan.shots)
        if position and not number:
            self.load_position(position)
        refires = 0
        self._wait_for(f"the time of shot {index}")
        while self._ending.wait_until(self._due_s):
            self._rebase()
            if not self._armed and not self._arm(self._plan.shots - number):
                return None
            shot, findings = self._fire(index, refires)
            if shot is None or not findings.missing or not self._refires_left:
                return shot
            self._refires_left -= 1
            refires += 1
            self._say(f"shot {index} is fired again, {self._refires_left} more permitted")
        return None

    def _arm(self, shots: int) -> bool:
        """Load the train, verify its echo, arm for these shots and the refires; False if the run is ended."""
        generator = self._rig.generator
        self._wait_for(f"{generator.name}: to load its pulse train")
        if deviation := train_deviation(self._timing, generator.configure(self._timing)):
            raise DeviceRefused(generator.name, f"loaded another pulse train: {deviation}")
        if self._ending.step:
            return False
        period_us = generator.arm(shots + self._refires_left, period_us=int(1e6 * self._period_s))
        self._shortest_s = max(self._timing.shortest_period_ns / 1e9, period_us / 1e6)
        self._armed = True
        return True

    def _darken(self) -> None:
        """Light off, confirmed; the generator is armed again before the next shot."""
        self._armed = False
        light.switch_off(self._rig)

    def _rebase(self) -> None:
        """Let the cameras tell the next firing from the last one; they read their clocks."""
        rebasing = SideBySide("begin shot", _begin_shot, self._rig.cameras)
        if not rebasing.wait(self._patience_s):
            self._darken()
        _raise_first(rebasing.errors(self._frame_deadline_s))

    def _fire(self, index: int, refires: int) -> tuple[Shot | None, ShotFindings]:
        """Fire and look at what came of it."""
        at = self._clock.now()
        fired = self._rig.generator.fire()
        self.last_fired = index
        commanded_s = at.steady_ns / 1e9
        self._due_s = next_due_s(self._due_s, (commanded_s, time.monotonic()), self._period_s, self._shortest_s)
        collected = self._collect(index)
        if collected is None:
            return None, ShotFindings()
        self._ask_silent(index, collected)
        lit = {view: one.current_a > 0 for view, one in self._timing.views.items()}
        views = marked(collected, lit, self._thresholds)
        findings = self._check(index, fired, views)
        key = self._plan.kind.image_key if findings.good else ImageKey.INVALID
        when = (at.host_time_ns, self._stage_z_mm, refires, at.period_ns, at.clock_step_ns)
        return Shot(index, key, views, fired, *when), findings

    def _collect(self, index: int) -> dict[str, DoubleFrame] | None:
        """Collect the exposures of all views before one common deadline; None if the run ends at once."""
        collecting = SideBySide("frames", self._frames_of, self._rig.cameras)
        too_late_s = time.monotonic() + self._frame_deadline_s + self._patience_s
        self._tell_missing(index, collecting)
        while not (collecting.wait(_SLICE_S) or collecting.has_failed or time.monotonic() > too_late_s):
            self._tell_missing(index, collecting)
            if self._ending.at_once:
                return None
        views = collecting.answers
        if self._armed and (len(views) < len(self._rig.cameras) or any(frames.silent for frames in views.values())):
            self._darken()
        if self._ending.at_once:
            return None
        _raise_first(collecting.errors(_ANSWER_LIMIT_S))
        return collecting.answers

    def _tell_missing(self, index: int, collecting: SideBySide[DoubleFrame]) -> None:
        missing = {view: camera for view, camera in self._rig.cameras.items() if view not in collecting.answers}
        half = [view for view, camera in missing.items() if camera.has_half]
        whole = [view for view in missing if view not in half]
        told = ((whole, "exposures A and B"), (half, "the second exposure"))
        parts = [f"{', '.join(views)}: {what}" for views, what in told if views]
        if parts:
            self._wait_for(f"{'; '.join(parts)} of shot {index}")

    def _frames_of(self, camera: Camera) -> DoubleFrame:
        return camera.collect(self._frame_deadline_s)

    def _ask_silent(self, index: int, views: dict[str, DoubleFrame]) -> None:
        """Whether cameras of which nothing came are there at all; it is dark."""
        silent = {view: self._rig.cameras[view] for view, frames in views.items() if frames.silent}
        if silent:
            self._say(f"shot {index}: nothing came from {', '.join(silent)}; light off")
            _raise_first(SideBySide("a question", _ask, silent).errors(_ANSWER_LIMIT_S))

    def _check(self, index: int, fired: FiredTrain, views: dict[str, DoubleFrame]) -> ShotFindings:
        findings = check_exposures(views, train_deviation(self._timing, fired) or "")
        if not findings.good:
            self._say(f"shot {index}: {findings}")
        return findings


def _begin_shot(camera: Camera) -> None:
    camera.begin_shot()


def _ask(camera: Camera) -> None:
    camera.ask()


def _raise_first(errors: dict[str, Exception]) -> None:
    for error in errors.values():
        raise error
