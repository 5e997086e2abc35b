"""ClusterEngine: runs tasks in the workers of a scheduler that other computers serve.

A worker that dies, a scheduler that is started again or a cable that is out ends no task: the scheduler gives it to
another worker, or it is given to the scheduler again. Files appear whole or not at all, so a task that is done twice
leaves what it leaves once.
"""

# mypy: allow-untyped-calls
# distributed is typed in parts only.

import asyncio
import time
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.metadata import version
from types import TracebackType
from typing import Any, Self
from uuid import uuid4

from distributed import Future
from distributed.scheduler import KilledWorker

from daq.counted import counted
from server.lab.engine.in_worker import Errand, perform_errand
from server.lab.engine.path_map import PathMap, as_seen_by_workers
from server.lab.engine.scheduler_link import CONNECT_S, SchedulerLink, silent
from server.lab.engine.task import OnProgress, Task, TaskAborted, TaskError, Unavailable, Values, settled
from server.rig.processing_config import ProcessingConfig

_TRY_AGAIN_S = 0.5
_Told = tuple[BaseException | None, dict[str, Any] | None]


@dataclass(eq=False)
class _Sent:
    """An errand under way."""

    job_id: str
    name: str
    on_progress: OnProgress
    aborted: asyncio.Event = field(default_factory=asyncio.Event)


class ClusterEngine:
    """Runs tasks in the workers of a scheduler.

    Parameters
    ----------
    config : ProcessingConfig
        With a scheduler.
    """

    def __init__(self, config: ProcessingConfig) -> None:
        if config.scheduler is None:
            raise ValueError("there is no scheduler")
        self._address, self._config = config.scheduler, config
        self._paths = PathMap(config.paths)
        self._session = uuid4().hex
        self._sent: dict[str, _Sent] = {}
        self._link: SchedulerLink | None = None
        self._linking = asyncio.Lock()
        self._missed_since_s: float | None = None

    @property
    def workers(self) -> int:
        """As many as the scheduler has; one where nobody knows, so that somebody asks."""
        return max(1, self._link.workers if self._link else 0)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def submit(self, job_id: str, task: Task, job: Values, on_progress: OnProgress) -> dict[str, Any]:
        """See ``Engine.submit``."""
        sent = _Sent(job_id, f"{self._session} {job_id}", on_progress)
        self._sent[sent.name] = sent
        limit_s = self._config.job_deadline_s
        try:
            async with asyncio.timeout(limit_s) as deadline:
                there, seen = await asyncio.to_thread(as_seen_by_workers, self._paths, job)
                return await self._insist(task, sent, Errand(sent.name, there, version("tomoshadow"), seen))
        except asyncio.CancelledError:
            await self._tell_to_abort(sent)  # whoever waited is gone: the task shall not stay behind
            raise
        except TimeoutError as error:
            if not deadline.expired():
                raise
            await self._tell_to_abort(sent)
            raise TaskError(
                f"{job_id}: no result from the workers of scheduler {self._address} within {limit_s:g} s "
                f"(job_deadline_s): is a worker frozen, or are there too few of them?"
            ) from error
        finally:
            del self._sent[sent.name]

    async def abort(self, job_id: str) -> None:
        """See ``Engine.abort``."""
        if sent := self._sent.get(f"{self._session} {job_id}"):
            await self._tell_to_abort(sent)

    async def close(self) -> None:
        """Tell all tasks to end, and leave the scheduler."""
        await asyncio.gather(*map(self._tell_to_abort, self._sent.values()))
        if self._link:
            await self._link.close()
            self._link = None

    async def _tell_to_abort(self, sent: _Sent) -> None:
        sent.aborted.set()
        if self._link:
            await self._link.tell_to_abort(sent.name)

    async def _insist(self, task: Task, sent: _Sent, errand: Errand) -> dict[str, Any]:
        """Ask one scheduler after the other until the task has ended."""
        while True:
            link = await self._linked(sent)
            future = link.client.submit(perform_errand, task, errand, pure=False)
            try:
                if told := await self._told(link, future):
                    error, result = told
                    if isinstance(error, KilledWorker):
                        raise TaskError(_deadly(sent.job_id, error)) from error
                    return settled(error, result)
            finally:
                with suppress(RuntimeError):  # of a client that is closed
                    future.release()  # a result that is still held is computed again when its worker dies
                await link.forget(sent.name)

    async def _told(self, link: SchedulerLink, future: "Future[Any]") -> _Told | None:
        """What a task raised, or its result; None if the scheduler was lost before that was here.

        Raises
        ------
        Unavailable
            The scheduler has had no workers for too long.
        """
        told, lost = asyncio.ensure_future(_fetched(future)), asyncio.ensure_future(link.lost.wait())
        try:
            while not told.done() and not lost.done():
                await asyncio.wait({told, lost}, timeout=_TRY_AGAIN_S, return_when=asyncio.FIRST_COMPLETED)
                self._require_workers(link)
        finally:
            told.cancel()
            lost.cancel()
        if not told.done() or told.cancelled() or told.exception() or future.status in ("cancelled", "lost"):
            link.lost.set()  # if it was not, the result was lost on its way: who does not know why takes another link
            return None
        return told.result()

    def _require_workers(self, link: SchedulerLink) -> None:
        limit_s = self._config.unreachable_s
        if link.workers == 0 and time.monotonic() - link.workers_left_s > limit_s and not link.lost.is_set():
            raise Unavailable(
                f"scheduler {self._address} has had no worker for {limit_s:g} s (unreachable_s): start some, "
                f"tomoshadow worker --scheduler {self._address}"
            )

    async def _linked(self, sent: _Sent) -> SchedulerLink:
        """The link, or another one where it is lost.

        Raises
        ------
        Unavailable
            No scheduler answers for too long.
        TaskAborted
            Nobody wants the errand any more.
        """
        async with self._linking:  # who else needs it waits, and finds it
            while self._link is None or self._link.lost.is_set():
                if sent.aborted.is_set():
                    raise TaskAborted
                await self._try_link()
            self._missed_since_s = None
            return self._link

    async def _try_link(self) -> None:
        limit_s = self._config.unreachable_s
        self._missed_since_s = self._missed_since_s or time.monotonic()
        try:
            await self._link_again(min(CONNECT_S, limit_s))
        except (OSError, TimeoutError) as error:
            if time.monotonic() - self._missed_since_s >= limit_s:
                raise silent(self._address, limit_s, "unreachable_s", error) from error
            await asyncio.sleep(_TRY_AGAIN_S)

    async def _link_again(self, within_s: float) -> None:
        if self._link is not None:
            lost, self._link = self._link, None
            await lost.close()
        self._link = await SchedulerLink.to(self._address, self._config.certificates, within_s, self._on_progress)

    def _on_progress(self, steps_by_name: dict[str, int]) -> None:
        for name, steps in steps_by_name.items():
            if sent := self._sent.get(name):
                sent.on_progress(steps)


async def _fetched(future: "Future[Any]") -> _Told:
    error = await future.exception()
    return (error, None) if error else (None, await future)


def _deadly(job_id: str, error: KilledWorker) -> str:
    return (
        f"{job_id}: {counted(error.allowed_failures + 1, 'worker')} died while doing it, the last was "
        f"{error.last_worker.address}: do they have too little memory (tomoshadow worker --memory)?"
    )
