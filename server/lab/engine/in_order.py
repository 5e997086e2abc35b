"""results_in_order: the jobs of a command that has no event loop, side by side in an engine."""

import asyncio
import logging
import threading
from collections.abc import Callable, Coroutine, Generator, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager
from typing import Any

from server.lab.engine.task import Engine, Task, Values

AHEAD = 2
"""Jobs under way per worker: the next one is there when a worker has ended one."""
_START_S = 120.0
_END_S = 15.0
_LOG = logging.getLogger(__name__)
Begin = Callable[[Coroutine[Any, Any, Any]], "Future[Any]"]


def results_in_order(engine: Engine, task: Task, jobs: Mapping[str, Values]) -> Generator[dict[str, Any], None, None]:
    """Do jobs, ``AHEAD`` per worker at a time, and yield their results in the order of the jobs.

    Where one fails, or the iterator is closed, those under way are told to end, and waited for: none of them writes
    anything after that, but those whose worker is out of reach.

    Parameters
    ----------
    engine : Engine
        Not yet started; started and ended here.
    task : Task
        Of every job.
    jobs : mapping of str to Values
        Names and arguments.

    Raises
    ------
    TaskError
        A job has failed.
    """
    waiting, done = iter(jobs.items()), dict[str, dict[str, Any]]()
    with _started(engine) as begin, _ending(engine, begin) as under_way:
        for wanted in jobs:
            while wanted not in done:
                while len(under_way) < AHEAD * engine.workers and (job := next(waiting, None)):
                    under_way[begin(engine.submit(job[0], task, job[1], _ignore))] = job[0]
                for ended in wait(under_way, return_when=FIRST_COMPLETED).done:
                    done[under_way.pop(ended)] = ended.result()
            yield done.pop(wanted)


@contextmanager
def _started(engine: Engine) -> Iterator[Begin]:
    """Run an engine in an event loop of its own, in a thread; yields what begins a coroutine there."""
    loop = asyncio.new_event_loop()
    loop.set_exception_handler(_leave_to_jobs)
    thread = threading.Thread(target=loop.run_forever, name="engine", daemon=True)
    thread.start()

    def begin(work: Coroutine[Any, Any, Any]) -> "Future[Any]":
        return asyncio.run_coroutine_threadsafe(work, loop)

    try:
        begin(engine.__aenter__()).result(_START_S)
        yield begin
    finally:
        begin(engine.close()).result(_START_S)
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


@contextmanager
def _ending(engine: Engine, begin: Begin) -> Iterator["dict[Future[Any], str]"]:
    """Names of jobs under way; what is left of them at the end is ended."""
    under_way: dict[Future[Any], str] = {}
    try:
        yield under_way
    finally:
        for name in under_way.values():
            begin(engine.abort(name))
        for late in wait(under_way, _END_S).not_done:
            late.cancel()


def _leave_to_jobs(_loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """What distributed loses of its own is told by the error of the job that it befalls, if it befalls one."""
    _LOG.debug("%s", context["message"], exc_info=context.get("exception"))


def _ignore(_steps: int) -> None:
    """Results are all that is waited for."""
