"""InlineEngine: runs tasks in threads of this process."""

import asyncio
from concurrent.futures import ThreadPoolExecutor
from threading import Event as ThreadEvent
from types import TracebackType
from typing import Any, Self

from server.lab.engine.task import OnProgress, StopSignal, Task, Values, perform, settled


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
        return settled(future.exception(), None if future.exception() else future.result())

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
