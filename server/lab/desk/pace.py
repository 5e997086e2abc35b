"""Pace: when the last shot of a run will be on the disk, by how fast they come."""

from collections.abc import Callable

from daq.run.events import RunStatus
from daq.run.state import RunState


class Pace:
    """Told of every status; goes by the plan until a shot has come since it was told of the run.

    However late a shot is, those after it take their time.

    Parameters
    ----------
    now_s : Callable[[], float]
        A clock that never goes back.
    """

    def __init__(self, now_s: Callable[[], float]) -> None:
        self._now_s = now_s
        self._run_id: str | None = None
        self._first = (0.0, 0)
        self._last = (0.0, 0)

    def eta_s(self, status: RunStatus) -> float | None:
        """Time until the last shot; None while that is not known, or no run takes shots."""
        if status.state is not RunState.ACQUIRING:
            return None
        now = (self._now_s(), status.shots_recorded)
        if status.run_id != self._run_id:
            self._run_id, self._first, self._last = status.run_id, now, now
        if now[1] > self._last[1]:
            self._last = now
        return self._left_s(status, now[0])

    def _left_s(self, status: RunStatus, now_s: float) -> float | None:
        shots = self._last[1] - self._first[1]
        left = status.shots_planned - status.shots_recorded
        if shots:
            each_s = (self._last[0] - self._first[0]) / shots
        elif status.plan is not None:
            each_s = 1 / status.plan.rate_hz
        else:
            return None
        return max(0.0, left * each_s - min(each_s, now_s - self._last[0]))
