"""SharedDoor: the door of a laboratory that other processes follow."""

import contextlib
import threading
from collections.abc import Generator
from queue import Empty, SimpleQueue


class SharedDoor:
    """The door switch of far ends that run for other processes; each of them is told of every move."""

    def __init__(self) -> None:
        self._moving = threading.Lock()
        self._closed = False
        self._followers: list[SimpleQueue[bool]] = []

    def close_door(self) -> None:
        """Let the chain conduct."""
        self._move(True)

    def open_door(self) -> None:
        """Interrupt the chain."""
        self._move(False)

    def break_wire(self) -> None:
        """Cut the cable."""
        self._move(False)

    def follow(self, alive_s: float) -> Generator[bool, None, None]:
        """Whether it is closed: now, after each move, and again after so many seconds without one."""
        moves: SimpleQueue[bool] = SimpleQueue()
        with self._moving:
            closed = self._closed
            self._followers.append(moves)
        try:
            while True:
                yield closed
                with contextlib.suppress(Empty):
                    closed = moves.get(timeout=alive_s)
        finally:
            with self._moving:
                self._followers.remove(moves)

    def _move(self, closed: bool) -> None:
        with self._moving:
            self._closed = closed
            for moves in self._followers:
                moves.put(closed)
