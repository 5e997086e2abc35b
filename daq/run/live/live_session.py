"""LiveSession: one live view, worked by a thread of its own: shoot until something ends it, then darkness.

This thread fires every shot, not the timer of the generator: with it, a thread that hangs would go on flashing for as
long as the guard sends the heartbeat.
"""

from dataclasses import replace
from itertools import count

from daq.run import light
from daq.run.darkness import attempt, darken
from daq.run.guard import RunGuard
from daq.run.live.live_start import Audience
from daq.run.shooting import Shooting
from daq.run.shots.shot_check import light_thresholds
from daq.run.shots.shot_taking import ShotTaker
from daq.run.state import RunStep


class LiveSession:
    """One live view. Nothing here raises: an error switches the light off, then ends it.

    Parameters
    ----------
    live : Shooting
        What to show, with which devices, and who is told.
    audience : Audience
        Who looks.
    """

    def __init__(self, live: Shooting, audience: Audience) -> None:
        self._live = live
        self._audience = audience
        self._rig = live.rig
        self._ending = live.ending

    def work(self) -> None:
        """Thread: the whole live view, until the light is confirmed off and the cameras are disarmed."""
        with RunGuard(self._live):
            attempt(self._live, self._show)
            if not self._ending.at_once:
                light.try_to_switch_off(self._rig)
        step = RunStep.LIGHT_UNKNOWN if darken(self._live) else RunStep.LIGHT_OFF
        self._live.progress.end(step, self._ending, live=None, message=self._ending.cause)

    def _show(self) -> None:
        live = self._live
        for observer in live.observers:
            observer.before_run(live.plan, None)
        # What is wrong with a shot is shown with it, and is no line of a log twice a second.
        bits = {view: camera.bits for view, camera in self._rig.cameras.items()}
        taker = ShotTaker(replace(live, quiet=True), light_thresholds(bits, {}, {}))
        self._arm(taker)
        for index in count():
            shot = taker.take(index)
            if shot is None:
                return
            live.progress.show(shot)
            self._look_around()

    def _arm(self, taker: ShotTaker) -> None:
        for camera in self._rig.cameras.values():
            if self._ending.step:
                return
            camera.arm()
        taker.load_position(0)

    def _look_around(self) -> None:
        limit_s = self._live.limits.live_unwatched_s
        if self._audience.absent_s > limit_s:
            self._ending.end(RunStep.STOP, f"nobody has looked at the live view for {limit_s:g} s")
