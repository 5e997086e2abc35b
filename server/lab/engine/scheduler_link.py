"""SchedulerLink: a connection to a Dask scheduler on another computer, and how its loss is noticed.

A link that is lost stays lost, and another one takes its place: what was asked by it is asked again.
"""

# mypy: allow-untyped-calls
# distributed is typed in parts only.

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

from dask import config
from distributed import Client, Event
from distributed.security import Security

from server.lab.engine.in_worker import PROGRESS_TOPIC, abort_event
from server.lab.engine.task import Unavailable
from server.rig.certificates import CA, CERTIFICATE, KEY

CONNECT_S = 5.0
ANSWER_S = 10.0
"""A scheduler that does not say in this time how many workers it has is lost."""
DEAD_S = 12.0
"""A connection by which nothing is acknowledged for so long is dead; Linux takes no less with Dask's ten probes."""
_LOOK_AGAIN_S = 1.0
_CLOSE_S = 3.0
LINK_SETTINGS = MappingProxyType(
    {
        "distributed.comm.timeouts.connect": f"{CONNECT_S:g}s",
        "distributed.comm.timeouts.tcp": f"{DEAD_S:g}s",
        "distributed.scheduler.worker-ttl": "60s",
    }
)
"""Of scheduler, workers and askers: by default a dead link is noticed after half a minute, a worker after five."""
Progress = Callable[[dict[str, int]], None]


def security_of(certificates: Path | None) -> Security:
    """With certificates nobody is spoken with who has none of the same CA; without them loopback alone is used."""
    if certificates is None:
        return Security()
    roles = ("client", "scheduler", "worker")
    files = {
        **{f"tls_{role}_cert": str(certificates / CERTIFICATE) for role in roles},
        **{f"tls_{role}_key": str(certificates / KEY) for role in roles},
    }
    return Security(require_encryption=True, tls_ca_file=str(certificates / CA), **files)


def prepare() -> None:
    """Let this process speak to a scheduler: what Dask logs of losses is told by errors that name the shot."""
    config.set(LINK_SETTINGS)
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)


def silent(scheduler: str, limit_s: float, limit: str, why: BaseException) -> Unavailable:
    """What an operator reads of a scheduler that does not answer."""
    reason = str(why.__cause__ or why) or type(why).__name__
    return Unavailable(
        f"scheduler {scheduler} does not answer within {limit_s:g} s ({limit}): {reason}; does tomoshadow scheduler "
        f"run there, are its certificates of the same CA, does a firewall let its port pass?"
    )


class SchedulerLink:
    """A connection that works until ``lost`` is set.

    Parameters
    ----------
    client : Client
        Connected.
    """

    def __init__(self, client: Client) -> None:
        self.client = client
        self.lost = asyncio.Event()
        self.workers = 0
        self.workers_left_s = time.monotonic()
        """When the last worker was seen; what came after it counts as time without any."""
        self._watch = asyncio.create_task(self._look())

    @classmethod
    async def to(cls, address: str, certificates: Path | None, within_s: float, on_progress: Progress) -> Self:
        """Connect.

        Raises
        ------
        OSError
            There is no answer in time, or it is not the answer of a scheduler that may be trusted.
        """
        prepare()
        client = Client(address, security=security_of(certificates), asynchronous=True, timeout=within_s)
        try:
            async with asyncio.timeout(2 * within_s):  # the client itself knows why, if it comes to its end
                await client
        except BaseException:
            await _closed(client)
            raise
        client.subscribe_topic(PROGRESS_TOPIC, lambda stamped: on_progress(stamped[1]))
        return cls(client)

    async def _look(self) -> None:
        """Task: ask the scheduler for its workers, until it does not answer."""
        scheduler: Any = self.client.scheduler
        try:
            while self.client.status == "running":
                async with asyncio.timeout(ANSWER_S):
                    self.workers = len(await scheduler.ncores())
                if self.workers:
                    self.workers_left_s = time.monotonic()
                await asyncio.sleep(_LOOK_AGAIN_S)
        except (OSError, TimeoutError):
            pass  # which is what it looks for
        finally:
            self.lost.set()

    async def tell_to_abort(self, name: str) -> None:
        """Let an errand end at its next step, if scheduler and worker still hear."""
        await self._heard(Event(abort_event(name), client=self.client).set)

    async def forget(self, name: str) -> None:
        """Let the scheduler forget that an errand was told to end."""
        await self._heard(Event(abort_event(name), client=self.client).clear)

    async def _heard(self, tell: Callable[[], Awaitable[None]]) -> None:
        if not self.lost.is_set():
            with suppress(OSError, TimeoutError):
                async with asyncio.timeout(ANSWER_S):
                    await tell()

    async def close(self) -> None:
        """Leave the scheduler, which goes on for others."""
        self._watch.cancel()
        self.lost.set()
        await _closed(self.client)


async def _closed(client: Any) -> None:
    with suppress(OSError, TimeoutError):
        async with asyncio.timeout(_CLOSE_S):
            await client.close()
