"""Beat: the pulse of the server. Pages hear it, and whoever asks for light says which one he heard last.

A request that waited somewhere on its way, in a browser or a network that was away, names an old beat and is refused.
"""

import time
from collections.abc import Callable

from server.lab.errors import Stale

PERIOD_S = 0.25
NEVER = 0
"""The beat of a page that has heard none yet."""
MOST_BEHIND_S = 2.0
"""Older requests make no light."""


class Beat:
    """Counts quarters of a second; a later life of the server counts on, so that no old number becomes a new one.

    Parameters
    ----------
    now_s : Callable[[], float]
        A clock that never goes back.
    since_s : float
        What the calendar said at the start.
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic, since_s: float | None = None) -> None:
        self._now_s = now_s
        self._offset_s = (time.time() if since_s is None else since_s) - now_s()

    @property
    def number(self) -> int:
        """The beat now."""
        return int((self._now_s() + self._offset_s) / PERIOD_S)

    def require_fresh(self, heard: int) -> None:
        """Refuse what was asked for after a beat of long ago, or one that has not been yet."""
        if heard == NEVER:
            raise Stale("this page had not heard the server yet: nothing was started, click again", "stale_request")
        behind_s = (self.number - heard) * PERIOD_S
        if behind_s > MOST_BEHIND_S:
            reason = f"this request was {behind_s:.1f} s on its way, more than {MOST_BEHIND_S:g} s: nothing was started"
            raise Stale(reason, "stale_request")
        if behind_s < -PERIOD_S:
            reason = f"this request names beat {heard}, which this server has not had: nothing was started"
            raise Stale(reason, "stale_request")
