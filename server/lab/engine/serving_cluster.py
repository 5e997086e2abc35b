"""A scheduler, and a worker that comes back to it: what ``tomoshadow scheduler`` and ``tomoshadow worker`` run.

Without certificates they listen at the loopback interface alone; what Dask shows by HTTP always does.
"""

# mypy: allow-untyped-calls
# distributed is typed in parts only.

import asyncio
import logging
import signal
import socket
import time
import warnings
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dask import config
from distributed import Nanny, Scheduler
from distributed.comm.addressing import get_address_host_port
from distributed.core import rpc

from server.lab.engine.dask_engine import ENVIRONMENT, MEMORY_THAT_STAYS
from server.lab.engine.in_worker import THREADS_VARIABLE, Prepared
from server.lab.engine.scheduler_link import CONNECT_S, prepare, security_of, silent

LOOPBACK, ALL = "127.0.0.1", "0.0.0.0"  # noqa: S104 - only with certificates
_HTTP = f"{LOOPBACK}:0"  # None would take the address of the rest
_TRY_AGAIN_S = 1.0
_START_S = 120.0
"""Two CPU-s on a machine where everybody else works, too."""
Tell = Callable[[str], None]


@dataclass(frozen=True)
class WorkerOptions:
    """How a worker works.

    Parameters
    ----------
    scheduler : str
        Its address.
    certificates : Path | None
        Folder of them; None on the loopback interface.
    memory : str
        The process is started again above it; ``"auto"``: the share of a processor.
    threads : int
        Of the kernels, within its one task at a time.
    wait_s : float
        So long it waits for a scheduler.
    modules : sequence of str
        What it loads before the first task.
    """

    scheduler: str
    certificates: Path | None
    memory: str
    threads: int
    wait_s: float
    modules: Sequence[str]


async def serve_scheduler(port: int, certificates: Path | None, tell: Tell) -> None:
    """Serve until SIGINT or SIGTERM."""
    _prepare()
    protocol, host = ("tls", ALL) if certificates else ("tcp", LOOPBACK)
    async with _told_to_end() as end:
        scheduler = Scheduler(
            host=host,
            port=port,
            protocol=protocol,
            security=security_of(certificates),
            dashboard=False,
            dashboard_address=_HTTP,
        )
        async with scheduler:
            tell(f"listens at {protocol}://{host}:{scheduler.port}; Ctrl-C ends it")
            await end.wait()


async def serve_worker(options: WorkerOptions, tell: Tell) -> None:
    """Work for a scheduler until SIGINT or SIGTERM; one that was lost is waited for.

    Raises
    ------
    Unavailable
        No scheduler answers for too long.
    """
    _prepare()
    config.set({ENVIRONMENT: config.get(ENVIRONMENT) | MEMORY_THAT_STAYS})
    async with _told_to_end() as end:
        while not end.is_set():
            await _await_scheduler(options, end, tell)
            try:
                await _work(options, end, tell)
            except (OSError, TimeoutError, RuntimeError) as error:  # the scheduler went while the process started, say
                tell(f"could not work, and tries again: {error.__cause__ or error or type(error).__name__}")


async def _work(options: WorkerOptions, end: asyncio.Event, tell: Tell) -> None:
    """Work until the scheduler is lost, or the end."""
    nanny = Nanny(
        options.scheduler,
        nthreads=1,
        memory_limit=options.memory,
        security=security_of(options.certificates),
        host=_own_address(options.scheduler),
        env={THREADS_VARIABLE: options.threads},
        death_timeout=_START_S,
        dashboard_address=_HTTP,
        plugins=(Prepared(options.modules),),
        silence_logs=logging.CRITICAL,
    )
    async with nanny:
        tell(f"works for {options.scheduler} as {nanny.worker_address}; Ctrl-C ends it")
        finished, ended = asyncio.ensure_future(nanny.finished()), asyncio.ensure_future(end.wait())
        await asyncio.wait({finished, ended}, return_when=asyncio.FIRST_COMPLETED)
        ended.cancel()
        finished.cancel()


def _own_address(scheduler: str) -> str:
    """That of this computer which its scheduler sees."""
    host, port = get_address_host_port(scheduler)
    family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    with socket.socket(family, kind, protocol) as asked:
        asked.connect(address)
        return str(asked.getsockname()[0])


async def _await_scheduler(options: WorkerOptions, end: asyncio.Event, tell: Tell) -> None:
    deadline_s, told = time.monotonic() + options.wait_s, False
    while not end.is_set():
        try:
            await _ask(options)
            return
        except (OSError, TimeoutError) as error:
            if time.monotonic() >= deadline_s:
                raise silent(options.scheduler, options.wait_s, "--wait", error) from error
            if not told:
                tell(f"waits for scheduler {options.scheduler}, {options.wait_s:g} s at most: {error}")
            told = True
        with suppress(TimeoutError):
            async with asyncio.timeout(_TRY_AGAIN_S):
                await end.wait()


async def _ask(options: WorkerOptions) -> None:
    """Have an answer of a scheduler."""
    arguments: Any = security_of(options.certificates).get_connection_args("worker")
    async with asyncio.timeout(2 * CONNECT_S), rpc(options.scheduler, connection_args=arguments) as scheduler:
        await scheduler.ncores()


def _prepare() -> None:
    warnings.filterwarnings("ignore", "Couldn't detect a suitable IP address")  # of a computer without the internet
    prepare()


@asynccontextmanager
async def _told_to_end() -> AsyncIterator[asyncio.Event]:
    """Set by SIGINT and SIGTERM."""
    loop, end = asyncio.get_running_loop(), asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, end.set)
    try:
        yield end
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.remove_signal_handler(number)
