"""DaskEngine: runs tasks in worker processes of this computer."""

# mypy: allow-untyped-calls
# distributed is typed in parts only.

import asyncio
import time
from collections.abc import Sequence
from contextlib import AsyncExitStack, suppress
from contextvars import copy_context
from types import TracebackType
from typing import Any, Self

from dask import config
from distributed import Client, Event, LocalCluster, Nanny

from server.lab.engine.in_worker import PROGRESS_TOPIC, Errand, Prepared, abort_event, perform_errand
from server.lab.engine.task import OnProgress, Task, TaskError, Unavailable, Values, settled
from server.lab.errors import told

ENVIRONMENT = "distributed.nanny.pre-spawn-environ"
MEMORY_THAT_STAYS = {"MALLOC_MMAP_THRESHOLD_": 32 << 20, "MALLOC_TRIM_THRESHOLD_": 256 << 20}
"""Distributed lets workers give memory back at once; measured: finding it anew doubles the CPU time of a shot."""

START_AGAIN_S = 10.0
"""After workers could not start; to try it costs a second of a processor."""

_NICENESS = 10  # measured: median answer time of the server under load falls from 65 to 24 ms


class DaskEngine:
    """Runs tasks in worker processes of this machine, reached on the loopback interface only.

    They start by themselves: whoever enters does not wait for them, the first task does. If they could not, a later
    task starts them again.

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
        self._context = copy_context()  # a client of distributed ends where it began
        self._client: asyncio.Task[Client] | None = None
        self._began_s = 0.0
        self._listeners: dict[str, OnProgress] = {}

    async def __aenter__(self) -> Self:
        self._begin()
        return self

    def _begin(self) -> None:
        self._began_s = time.monotonic()
        self._client = asyncio.create_task(self._start(), context=self._context)

    async def _start(self) -> Client:
        try:
            return await self._enter()
        except Exception:
            await self._stack.aclose()
            raise

    async def _enter(self) -> Client:
        environment = config.get(ENVIRONMENT) | MEMORY_THAT_STAYS
        self._stack.enter_context(config.set({ENVIRONMENT: environment}))
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
        client: Client = await self._stack.enter_async_context(Client(cluster, asynchronous=True))
        await client.register_plugin(Prepared(self._modules, _NICENESS))
        client.subscribe_topic(PROGRESS_TOPIC, self._on_progress)
        return client

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
        client = await self._started()
        self._listeners[job_id] = on_progress
        future = client.submit(perform_errand, task, Errand(job_id, dict(job)), pure=False)
        try:
            error = await future.exception()
            await Event(abort_event(job_id), client=client).clear()
            return settled(error, None if error else await future)
        except asyncio.CancelledError:
            await self.abort(job_id)  # whoever waited is gone: the task shall not stay behind
            raise
        finally:
            future.release()  # a result that is still held is computed again when its worker dies
            del self._listeners[job_id]

    async def abort(self, job_id: str) -> None:
        """See ``Engine.abort``; cancelling the future would not stop a running task."""
        await Event(abort_event(job_id), client=await self._started()).set()

    async def close(self) -> None:
        """End scheduler and workers."""
        starting, self._client = self._client, None
        if starting is not None:  # workers that are just being started are known to nobody else
            with suppress(Exception):  # if they could not, nobody has missed them
                await asyncio.shield(starting)
        await asyncio.create_task(self._stack.aclose(), context=self._context)

    async def _started(self) -> Client:
        """Wait for the workers; Unavailable if they cannot start."""
        if self._client is None:
            raise TaskError("the engine is not running")
        if self._has_failed and time.monotonic() - self._began_s > START_AGAIN_S:
            self._begin()
        starting = self._client
        await asyncio.wait([starting])
        if error := starting.exception():
            raise Unavailable(f"the workers did not start: {told(error)}")
        return starting.result()

    @property
    def _has_failed(self) -> bool:
        starting = self._client
        return starting is not None and starting.done() and starting.exception() is not None
