"""FaultEnds: the ends of lasting faults that are still to come."""

import threading
from collections.abc import Callable

from daq.faults import FaultKind

Key = tuple[FaultKind, str | None]
"""One fault: its kind, and whose it is."""


class FaultEnds:
    """One end at most per fault, each in a thread of its own."""

    def __init__(self) -> None:
        self._changing = threading.Lock()
        self._timers: dict[Key, threading.Timer] = {}
        self._over = False

    def put(self, fault: Key, delay_s: float, end: Callable[[], None]) -> None:
        """End a fault after a while; takes the place of an end that was put before."""
        timer = threading.Timer(delay_s, self._run, (fault, end))
        timer.daemon = True
        with self._changing:
            self._cancel(fault)
            if not self._over:
                self._timers[fault] = timer
                timer.start()

    def cancel(self, fault: Key) -> None:
        """Let a fault stay."""
        with self._changing:
            self._cancel(fault)

    def close(self) -> None:
        """No fault ends any more; one that is just ending has ended."""
        with self._changing:
            self._over = True
            for fault in tuple(self._timers):
                self._cancel(fault)

    def _cancel(self, fault: Key) -> None:
        timer = self._timers.pop(fault, None)
        if timer is not None:
            timer.cancel()

    def _run(self, fault: Key, end: Callable[[], None]) -> None:
        with self._changing:
            if self._timers.get(fault) is threading.current_thread():
                del self._timers[fault]
                end()
