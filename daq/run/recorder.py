"""Recorder: a bounded queue and threads that compress shots side by side and commit them in order."""

import threading
import time
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import Self

from daq.errors import RecorderError, RecorderOverflow, StorageError
from daq.files.run_directory import RunWriter
from daq.shot import Shot


def _nobody_listens(_: Shot | RecorderError) -> None:
    """Not every recorder has a listener."""


class Recorder:
    """Stores shots while the next ones are taken. ``with Recorder(writer) as recorder`` starts the threads.

    Compression runs outside of the GIL, so that two threads use two cores; commits are made in the order
    of indices, so that readers never see a gap. Nothing is lost silently: a full queue, a full disk or a
    missing index is raised by the next ``put`` and by ``close``.

    Parameters
    ----------
    writer : RunWriter
        The open run.
    depth : int
        Shots that may wait or be in work at the same time.
    threads : int
        Writer threads.
    on_commit : Callable[[Shot], None]
        Called by a writer thread after a shot has reached the disk, in the order of indices.
    on_failure : Callable[[RecorderError], None]
        Called by a writer thread as soon as a shot cannot be stored while others are taken: there is light.
    """

    def __init__(
        self,
        writer: RunWriter,
        depth: int = 8,
        threads: int = 2,
        on_commit: Callable[[Shot], None] = _nobody_listens,
        on_failure: Callable[[RecorderError], None] = _nobody_listens,
    ) -> None:
        self._writer = writer
        self._depth = depth
        self._on_commit = on_commit
        self._on_failure = on_failure
        self._threads = [threading.Thread(target=self._work, name=f"recorder-{n}", daemon=True) for n in range(threads)]
        self._changed = threading.Condition()
        self._waiting: deque[Shot] = deque()
        self._accepted = 0
        self._committed = 0
        self._closing = False
        self._given_up = False
        self._failure: tuple[int, Exception] | None = None

    def __enter__(self) -> Self:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not self._closing:
            self.close()

    @property
    def committed(self) -> int:
        """Shots that are on the disk."""
        with self._changed:
            return self._committed

    @property
    def accepted(self) -> int:
        """Shots that were handed over: on the disk, waiting, or lost with an error."""
        with self._changed:
            return self._accepted

    def put(self, shot: Shot) -> None:
        """Hand over the next shot; never waits.

        Raises
        ------
        RecorderOverflow
            ``depth`` shots are waiting: the disk does not keep up.
        RecorderError
            An earlier shot could not be stored (the cause is attached), this one is out of order, or the
            recorder is closed.
        """
        with self._changed:
            self._raise_failure()
            if self._closing:
                raise RecorderError(f"shot {shot.index} came after the recorder was closed")
            if shot.index != self._accepted:
                raise RecorderError(f"shot {shot.index} is out of order, the next one is {self._accepted}")
            if self._accepted - self._committed >= self._depth:
                raise RecorderOverflow(
                    f"shot {shot.index}: {self._depth} shots wait already, the disk does not keep up"
                )
            self._waiting.append(shot)
            self._accepted += 1
            self._changed.notify_all()

    def close(self, deadline_s: float = 60.0) -> None:
        """Store what waits and end the threads.

        Raises
        ------
        RecorderOverflow
            The deadline passed before all were stored; none is stored later: a run that is closed stays as it is.
        RecorderError
            A shot could not be stored.
        """
        deadline = time.monotonic() + deadline_s
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        for thread in self._threads:
            thread.join(max(0.0, deadline - time.monotonic()))
        with self._changed:
            self._raise_failure()
            if self._committed < self._accepted:
                self._given_up = True
                left = self._accepted - self._committed
                raise RecorderOverflow(f"{left} of {self._accepted} shots are not stored after {deadline_s:g} s")

    def _raise_failure(self) -> None:
        if self._failure is not None:
            raise _told(*self._failure) from self._failure[1]

    def _work(self) -> None:
        """Thread: take a shot, compress and stage it, commit it when its turn comes."""
        while (shot := self._take()) is not None:
            try:
                self._writer.stage(shot.index, self._writer.encode(shot))
                self._commit_in_turn(shot)
            except Exception as error:  # noqa: BLE001  the top of a thread: the next put and close raise it
                self._fail(shot.index, error)

    def _take(self) -> Shot | None:
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._closing or self._failure)
            return self._waiting.popleft() if self._waiting and not (self._failure or self._given_up) else None

    def _commit_in_turn(self, shot: Shot) -> None:
        with self._changed:
            self._changed.wait_for(lambda: self._committed == shot.index or self._is_hopeless(shot.index))
            if self._committed != shot.index or self._given_up:
                self._writer.discard(shot.index)
                return
        self._writer.commit(shot.index)
        self._on_commit(shot)
        with self._changed:
            self._committed += 1
            self._changed.notify_all()

    def _is_hopeless(self, index: int) -> bool:
        return self._given_up or (self._failure is not None and self._failure[0] < index)

    def _fail(self, index: int, error: Exception) -> None:
        """Keep the failure of the lowest index: whatever is staged before it is still committed."""
        with self._changed:
            if self._failure is None or index < self._failure[0]:
                self._failure = (index, error)
            is_late = self._closing  # the light of this run is off, and there may be that of another one
            self._changed.notify_all()
        if not is_late:
            self._on_failure(_told(index, error))


def _told(index: int, cause: Exception) -> RecorderError:
    """Whatever kept a shot from the disk, with its number; what the disk refused keeps its kind."""
    kind = type(cause) if isinstance(cause, StorageError) else RecorderError
    return kind(f"shot {index} cannot be stored: {cause}")
