"""Engine: runs tasks outside the process that serves the laboratory; the only home of ``distributed``.

A task is a module-level function ``(job, should_stop) -> result``. It gets and returns small JSON values (paths, not
arrays) and calls ``should_stop`` between steps; every call is also its sign of progress. Once ``should_stop`` has
answered True the task counts as aborted, whatever it returns or raises afterwards.
"""

# mypy: allow-untyped-calls
# distributed is typed in parts only.

import asyncio
import os
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AsyncExitStack
from importlib import import_module
from threading import Event as ThreadEvent
from threading import Thread
from types import TracebackType
from typing import Any, Protocol, Self

import cv2
from dask import config
from distributed import Client, Event, LocalCluster, Nanny, WorkerPlugin, get_worker

from server.lab.errors import told

Values = Mapping[str, Any]
Task = Callable[[dict[str, Any], Callable[[], bool]], dict[str, Any]]
OnProgress = Callable[[int], None]

_PROGRESS_TOPIC = "tomoshadow-progress"
_POLL_PERIOD_S = 0.05  # a poll costs a round trip to the scheduler, about 10 ms under load
_NICENESS = 10  # measured: median answer time of the server under load falls from 65 to 24 ms
_ENVIRONMENT = "distributed.nanny.pre-spawn-environ"
_MEMORY_THAT_STAYS = {"MALLOC_MMAP_THRESHOLD_": 32 << 20, "MALLOC_TRIM_THRESHOLD_": 256 << 20}
"""Distributed lets workers give memory back at once; measured: finding it anew doubles the CPU time of a shot."""


class TaskError(Exception):
    """The task raised, or its worker died more than once; the text says why."""


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
            The task raised, or its worker died again and again.
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


class InlineEngine:
    """Runs tasks in threads of this process: for tests, and for machines too small for workers."""

    def __init__(self, workers: int = 1) -> None:
        self.workers = workers
        self._stops: dict[str, ThreadEvent] = {}
        self._pool: ThreadPoolExecutor | None = None

    async def __aenter__(self) -> Self:
        self._pool = ThreadPoolExecutor(self.workers, thread_name_prefix="task")
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def submit(self, job_id: str, task: Task, job: Values, on_progress: OnProgress) -> dict[str, Any]:
        """See ``Engine.submit``."""
        loop = asyncio.get_running_loop()
        asked = self._stops[job_id] = ThreadEvent()
        stop = StopSignal(asked.is_set, lambda steps: _report_to(loop, on_progress, steps))
        future = loop.run_in_executor(self._pool, perform, task, dict(job), stop)
        try:
            await asyncio.wait([future])
        finally:
            asked.set()  # whoever waited may be gone: the task shall not stay behind
            del self._stops[job_id]
        return _settle(future.exception(), None if future.exception() else future.result())

    async def abort(self, job_id: str) -> None:
        """See ``Engine.abort``."""
        if job_id in self._stops:
            self._stops[job_id].set()

    async def close(self) -> None:
        """Stop all tasks and wait for their threads."""
        for asked in self._stops.values():
            asked.set()
        if self._pool is not None:
            await asyncio.to_thread(self._pool.shutdown)


def _report_to(loop: asyncio.AbstractEventLoop, on_progress: OnProgress, steps: int) -> None:
    loop.call_soon_threadsafe(on_progress, steps)


def _settle(error: BaseException | None, result: dict[str, Any] | None) -> dict[str, Any]:
    if error is not None:
        raise TaskError(told(error)) from error
    if result is None:
        raise TaskAborted
    return result


class _QuietNeighbour(WorkerPlugin):
    """Workers give way to acquisition and server, and use one core each; meanwhile they load what tasks will need."""

    def __init__(self, modules: Sequence[str]) -> None:
        self._modules = modules

    def setup(self, worker: object) -> None:  # noqa: ARG002 - signature of distributed
        os.nice(_NICENESS)
        cv2.setNumThreads(1)
        Thread(target=_load, args=(self._modules,), name="load tasks", daemon=True).start()


def _load(modules: Sequence[str]) -> None:
    for module in modules:
        import_module(module)


def _perform_in_worker(task: Task, job_id: str, job: dict[str, Any]) -> dict[str, Any] | None:
    worker, asked = get_worker(), Event(_event_name(job_id))
    return perform(
        task, job, StopSignal(asked.is_set, lambda steps: worker.log_event(_PROGRESS_TOPIC, {job_id: steps}))
    )


def _event_name(job_id: str) -> str:
    return f"abort {job_id}"


class DaskEngine:
    """Runs tasks in worker processes of this machine, reached on the loopback interface only.

    Parameters
    ----------
    workers : int
        Number of processes, one task each.
    memory_limit : str
        Memory per worker, for example ``"4GiB"``; a worker above it is restarted. ``"auto"``: an equal share.
    modules : sequence of str
        What every worker imports as soon as it has started: to load it takes longer than a shot does.
    """

    def __init__(self, workers: int = 1, memory_limit: str = "auto", modules: Sequence[str] = ()) -> None:
        self.workers = workers
        self._modules = modules
        self._memory_limit = memory_limit
        self._stack = AsyncExitStack()
        self._client: Client | None = None
        self._listeners: dict[str, OnProgress] = {}

    async def __aenter__(self) -> Self:
        environment = config.get(_ENVIRONMENT) | _MEMORY_THAT_STAYS
        self._stack.enter_context(config.set({_ENVIRONMENT: environment}))
        cluster = await self._stack.enter_async_context(
            LocalCluster(
                n_workers=self.workers,
                threads_per_worker=1,
                processes=True,
                asynchronous=True,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",  # None would still open a fixed port
                scheduler_kwargs={"dashboard": False},
                memory_limit=self._memory_limit,
                silence_logs=50,
                worker_class=Nanny,
            )
        )
        client = await self._stack.enter_async_context(Client(cluster, asynchronous=True))
        await client.register_plugin(_QuietNeighbour(self._modules))
        client.subscribe_topic(_PROGRESS_TOPIC, self._on_progress)
        self._client = client
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    def _on_progress(self, stamped: tuple[float, dict[str, int]]) -> None:
        for job_id, steps in stamped[1].items():
            if job_id in self._listeners:
                self._listeners[job_id](steps)

    async def submit(self, job_id: str, task: Task, job: Values, on_progress: OnProgress) -> dict[str, Any]:
        """See ``Engine.submit``."""
        client = self._started()
        self._listeners[job_id] = on_progress
        future = client.submit(_perform_in_worker, task, job_id, dict(job), pure=False)
        try:
            error = await future.exception()
            return _settle(error, None if error else await future)
        finally:
            future.release()  # a result that is still held is computed again when its worker dies
            del self._listeners[job_id]
            await Event(_event_name(job_id), client=client).clear()

    async def abort(self, job_id: str) -> None:
        """See ``Engine.abort``; cancelling the future would not stop a running task."""
        await Event(_event_name(job_id), client=self._started()).set()

    async def close(self) -> None:
        """End scheduler and workers."""
        self._client = None
        await self._stack.aclose()

    def _started(self) -> Client:
        if self._client is None:
            raise TaskError("the engine is not running")
        return self._client
