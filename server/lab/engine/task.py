"""What a task and an engine are.

A task is a module-level function ``(job, should_stop) -> result``. It gets and returns small JSON values (paths, not
arrays) and calls ``should_stop`` between steps; every call is also its sign of progress. Once ``should_stop`` has
answered True the task counts as aborted, whatever it returns or raises afterwards.
"""

import time
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Any, Protocol, Self

from server.lab.errors import ServerError, told

Values = Mapping[str, Any]
Task = Callable[[dict[str, Any], Callable[[], bool]], dict[str, Any]]
OnProgress = Callable[[int], None]

_POLL_PERIOD_S = 0.05  # a poll costs a round trip to the scheduler, about 10 ms under load


class TaskError(ServerError):
    """The task raised, its worker died more than once, or it had no result in time; the text says why."""


class Unavailable(TaskError):
    """There is nobody to run the task, and the task is not to blame: it may be tried again; the text says why."""


class TaskAborted(Exception):
    """The task stopped because it was asked to."""


class Engine(Protocol):
    """Where tasks run. ``async with engine:`` starts and ends its workers."""

    @property
    def workers(self) -> int:
        """Number of tasks that run at the same time."""

    async def __aenter__(self) -> Self: ...

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    async def submit(self, job_id: str, task: Task, job: Values, on_progress: OnProgress) -> dict[str, Any]:
        """Run a task and wait for its result.

        Parameters
        ----------
        job_id : str
            Names the task for ``abort``; unique among the running ones.
        task : Task
            Module-level function.
        job : Values
            Its argument, JSON values.
        on_progress : OnProgress
            Called in the event loop with the number of steps done, 0 when the task starts.

        Raises
        ------
        TaskError
            The task raised, or its worker died again and again, or it had no result in time.
        Unavailable
            There was nobody to run it.
        TaskAborted
            ``abort`` was called and the task obeyed.
        """

    async def abort(self, job_id: str) -> None:
        """Ask a running task to stop; returns at once."""

    async def close(self) -> None:
        """End all workers."""


class StopSignal:
    """The ``should_stop`` of one task: asks at most every 50 ms, reports each step, remembers a True answer."""

    def __init__(self, ask: Callable[[], bool], report: OnProgress) -> None:
        self._ask = ask
        self._report = report
        self._steps = 0
        self._next_poll_s = 0.0
        self.seen = False

    def __call__(self) -> bool:
        """One step done; True if the task shall stop."""
        now_s = time.monotonic()
        if not self.seen and now_s >= self._next_poll_s:
            self.seen = self._ask()
            self._report(self._steps)
            self._next_poll_s = now_s + _POLL_PERIOD_S
        self._steps += 1
        return self.seen


def perform(task: Task, job: dict[str, Any], stop: StopSignal) -> dict[str, Any] | None:
    """Run a task in this thread; None if it was aborted."""
    if stop():
        return None
    try:
        result = task(job, stop)
    except Exception:
        if not stop.seen:
            raise
        return None
    return None if stop.seen else result


def settled(error: BaseException | None, result: dict[str, Any] | None) -> dict[str, Any]:
    """The result of a task, or what became of it as an error."""
    if error is not None:
        raise TaskError(told(error)) from error
    if result is None:
        raise TaskAborted
    return result
