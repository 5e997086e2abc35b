"""FiringClock: when shots were fired, by the clock of the host, and by one that nobody sets."""

import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class FiringTime:
    """When a shot was fired.

    Parameters
    ----------
    host_time_ns : int
        Unix time.
    steady_ns : int
        The monotonic clock.
    period_ns : int
        Since the firing before, by the monotonic clock; 0 for the first one.
    clock_step_ns : int
        By how much Unix time went on more than that.
    """

    host_time_ns: int
    steady_ns: int
    period_ns: int = 0
    clock_step_ns: int = 0


class FiringClock:
    """Tells the time of one firing after the other.

    Parameters
    ----------
    unix_ns, steady_ns : Callable[[], int]
        The two clocks.
    """

    def __init__(
        self, unix_ns: Callable[[], int] = time.time_ns, steady_ns: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self._unix_ns = unix_ns
        self._steady_ns = steady_ns
        self._before: FiringTime | None = None

    def now(self) -> FiringTime:
        """The time of the firing that follows at once."""
        unix_ns, steady_ns, before = self._unix_ns(), self._steady_ns(), self._before
        if before is None:
            self._before = FiringTime(unix_ns, steady_ns)
        else:
            period_ns = steady_ns - before.steady_ns
            self._before = FiringTime(unix_ns, steady_ns, period_ns, unix_ns - before.host_time_ns - period_ns)
        return self._before
