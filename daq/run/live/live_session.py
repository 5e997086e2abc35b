"""LiveSession: one live view, worked by a thread of its own: shoot until something ends it, then darkness.

This thread fires every shot, not the timer of the generator: with it, a thread that hangs would go on flashing for as
long as the guard sends the heartbeat.
"""

from itertools import count

from daq.errors import DaqError
from daq.run import light
from daq.run.guard import RunGuard
from daq.run.live.active_live import ActiveLive
from daq.run.shot_check import light_thresholds
from daq.run.shot_taking import ShotTaker
from daq.run.side_by_side import disarm_cameras
from daq.run.state import RunStep


class LiveSession:
    """One live view. Nothing here raises: an error switches the light off, then ends it.

    Parameters
    ----------
    live : ActiveLive
        What to show, with which devices, and who is told.
    """

    def __init__(self, live: ActiveLive) -> None:
        self._live = live
        self._rig = live.rig
        self._ending = live.ending

    def work(self) -> None:
        """Thread: the whole live view, until the light is confirmed off and the cameras are disarmed."""
        with RunGuard(self._live):
            self._shoot()
            light.try_to_switch_off(self._rig)
        step = self._end()
        self._live.progress.move(step, live=None, message=self._ending.cause)

    def _shoot(self) -> None:
        """Whatever goes wrong, the light goes off before anything else."""
        try:
            self._show()
        except (DaqError, OSError) as error:
            self._fail(str(error))
        except Exception as error:  # noqa: BLE001  the top of a thread: a bug must not leave the light on
            self._fail(f"internal error: {error!r}")

    def _show(self) -> None:
        live = self._live
        for observer in live.observers:
            observer.before_run(live.plan)
        taker = ShotTaker(live, light_thresholds({view: one.bits for view, one in self._rig.cameras.items()}, {}, {}))
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
        if self._live.audience.absent_s > limit_s:
            self._ending.end(RunStep.STOP, f"nobody has looked at the live view for {limit_s:g} s")

    def _end(self) -> RunStep:
        """Light off, then cameras."""
        limits = self._live.limits
        reason = light.confirm_off(self._rig, limits.light_off_s)
        if reason:
            self._ending.end(RunStep.ERROR, f"light not confirmed off: {reason}")
        for problem in disarm_cameras(self._rig.cameras, limits.disarm_s).values():
            self._live.progress.say(problem)
        return RunStep.LIGHT_UNKNOWN if reason else RunStep.LIGHT_OFF

    def _fail(self, cause: str) -> None:
        light.try_to_switch_off(self._rig)
        if not self._ending.end(RunStep.ERROR, cause) and cause != self._ending.cause:
            self._live.progress.say(cause)
