"""EventPublisher: what happens in any thread becomes one numbered sequence in the event loop.

History is bounded. A reader that comes back names the last event it saw and gets the rest; a reader that is too slow
misses the oldest events, sees a gap in the numbers, and holds nobody up.
"""

import asyncio
import threading
from collections import deque
from collections.abc import AsyncIterator, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any

from daq.run.events import RunEvent, RunMessage, ShotRecorded, StateChanged

HISTORY = 2000
RUN_EVENTS = {StateChanged: "run_state", ShotRecorded: "shot_recorded", RunMessage: "run_message"}
_KEEP_ALIVE_S = 15.0


@dataclass(frozen=True)
class Event:
    """Something that happened.

    Parameters
    ----------
    id : int
        Position in the sequence, from 1.
    name : str
        Kind of event, for example ``shot_recorded``.
    time_utc : str
        ISO 8601.
    data : Mapping[str, Any]
        JSON values.
    """

    id: int
    name: str
    time_utc: str
    data: Mapping[str, Any]


class EventPublisher:
    """Joins the acquisition thread, the jobs and the pages."""

    def __init__(self, history: int = HISTORY) -> None:
        self._lock = threading.Lock()
        self._history: deque[Event] = deque(maxlen=history)
        self._newest = 0
        self._loop: asyncio.AbstractEventLoop | None = None
        self._changed = asyncio.Event()

    def attach(self) -> None:
        """Wake readers in the running event loop from now on."""
        self._changed = asyncio.Event()
        with self._lock:
            self._loop = asyncio.get_running_loop()

    def detach(self) -> None:
        """Readers get what they have not seen, and end; events are still kept. From any thread."""
        with self._lock:
            loop, self._loop = self._loop, None
            if loop is not None:
                loop.call_soon_threadsafe(self._wake)

    @property
    def newest(self) -> int:
        """Id of the newest event, 0 before the first."""
        return self._newest

    def publish(self, name: str, **data: Any) -> Event:
        """Add an event; from any thread, never waits for a reader."""
        with self._lock:
            self._newest += 1
            event = Event(self._newest, name, datetime.now(UTC).isoformat(timespec="milliseconds"), data)
            self._history.append(event)
            if self._loop is not None:
                self._loop.call_soon_threadsafe(self._wake)
        return event

    def publish_run_event(self, event: RunEvent) -> None:
        """Add what acquisition says; ``daq.run.acquisition.Acquisition`` gets this as its ``publish``."""
        self.publish(RUN_EVENTS[type(event)], **asdict(event))

    def since(self, last_id: int) -> list[Event]:
        """Events after ``last_id``; all that are kept if it comes from another life of the server."""
        with self._lock:
            if last_id > self._newest:
                return list(self._history)
            return [event for event in self._history if event.id > last_id]

    async def follow(self, last_id: int) -> AsyncIterator[Event | None]:
        """Events after ``last_id`` as they happen, until ``detach``; None every 15 s without one."""
        while True:
            changed, over = self._changed, self._loop is None
            events = self.since(last_id)
            for event in events:
                yield event
                last_id = event.id
            if over:
                return
            if not events and not await _waited(changed):
                yield None

    def _wake(self) -> None:
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()


async def _waited(changed: asyncio.Event) -> bool:
    try:
        async with asyncio.timeout(_KEEP_ALIVE_S):
            await changed.wait()
    except TimeoutError:
        return False
    return True
