"""DeskWatch: the state of the rig, looked at twice a second, so that no page has to ask a device."""

import asyncio
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from daq.run.events import RunStatus
from daq.run.state import RunState
from server.lab.desk.alarms import Alarm, AlarmList
from server.lab.desk.pace import Pace
from server.lab.desk.reason import UNSEEN, Reason
from server.lab.desk.rig_state import RigState, rig_state
from server.lab.duty import Duty, pause

_STALE_S = 3.0
"""A rig that nobody has looked at for so long is not ready; a silent generator takes a second."""

Look = Callable[[], tuple[Reason, ...]]
"""Finds everything that speaks against a start; blocks."""
FindAlarms = Callable[[], Iterable[Alarm]]
"""Finds everything that is wrong; blocks."""


@dataclass(frozen=True)
class _Seen:
    """What a look has found, what acquisition did then, and when."""

    reasons: tuple[Reason, ...]
    state: RunState
    at_s: float


class DeskWatch:
    """Keeps what was found last.

    Parameters
    ----------
    status : Callable[[], RunStatus]
        What acquisition does; asked whenever somebody wants to know the state.
    look, find_alarms : Look, FindAlarms
        Asked again and again, outside of the event loop.
    now_s : Callable[[], float]
        A clock that never goes back.
    period_s : float
        After which they are asked again.
    """

    def __init__(
        self,
        status: Callable[[], RunStatus],
        look: Look,
        find_alarms: FindAlarms = tuple,
        now_s: Callable[[], float] = time.monotonic,
        period_s: float = 0.5,
    ) -> None:
        self._status = status
        self._look = look
        self._find_alarms = find_alarms
        self._alarms = AlarmList()
        self._now_s = now_s
        self._period_s = period_s
        self._pace = Pace(now_s)
        self._seen: _Seen | None = None

    async def run(self, duty: Duty) -> None:
        """Look until cancelled."""
        while True:
            with duty.item("readiness"):
                await asyncio.to_thread(self.look)
            with duty.item("alarms"):
                await asyncio.to_thread(self.look_for_alarms)
            await pause(self._period_s)

    def look(self) -> RigState:
        """Look now; blocks."""
        state = self._status().state
        self._seen = _Seen(self._look(), state, self._now_s())
        return self.state

    def look_for_alarms(self) -> tuple[Alarm, ...]:
        """Look now; blocks."""
        return self._alarms.update(self._find_alarms())

    @property
    def alarms(self) -> tuple[Alarm, ...]:
        """What was wrong at the last look."""
        return self._alarms.now

    def acknowledge(self, alarm_id: str) -> Alarm:
        """An operator has seen an alarm; NotFound if it is gone."""
        return self._alarms.acknowledge(alarm_id)

    @property
    def state(self) -> RigState:
        """What acquisition does now, and what was found at the last look."""
        return self.state_for(self._seen.reasons if self._seen else ())

    def state_for(self, reasons: Sequence[Reason]) -> RigState:
        """The same, where this speaks against a start."""
        status = self._status()
        return rig_state(status, reasons if self._has_seen(status.state) else (UNSEEN,), self._pace.eta_s(status))

    def _has_seen(self, state: RunState) -> bool:
        """Whether somebody has looked, not long ago, while acquisition did what it does now."""
        seen = self._seen
        return seen is not None and seen.state is state and self._now_s() - seen.at_s < _STALE_S
