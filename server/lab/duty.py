"""Duty: work that goes on in the background until the server ends, whatever happens to it; and the lamps.

A loop guards each of its items: one that fails is told, and the loop goes on. A loop that ends by an error all the same
is started again, after a pause that grows. From the first error until the same part has worked again the duty has a
red lamp with the reason.
"""

import asyncio
import logging
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from enum import StrEnum
from typing import Annotated, Any

from pydantic import Field

from daq.frozen_model import FrozenModel
from server.lab.errors import told
from server.lab.events import EventPublisher

FIRST_PAUSE_S = 1.0
LONGEST_PAUSE_S = 60.0
_LOOP = "its loop"
_LOG = logging.getLogger(__name__)


class Health(StrEnum):
    """Colour of a lamp: green, amber, red."""

    OK = "ok"
    WARN = "warn"
    FAULT = "fault"


class Lamp(FrozenModel):
    """State of one part of the rig, or of work in the background that fails."""

    name: Annotated[str, Field(description="of the device, or of the work")]
    kind: Annotated[str, Field(description="camera, generator, interlock, stage, disk, simulator or work")]
    health: Annotated[Health, Field(description="ok: green; warn: amber, it works or nobody knows; fault: red")]
    detail: Annotated[str, Field(description="what was found, or why nothing was")]
    age_s: Annotated[float | None, Field(description="since the device last answered; null: never, or no device")] = (
        None
    )

    @property
    def trouble(self) -> str:
        """The detail without the age of the last answer: the same as long as the trouble is the same."""
        return self.detail.split("; last answer ")[0]


class Duty:
    """One background loop, and what is wrong with it.

    Parameters
    ----------
    name : str
        For the operator.
    events : EventPublisher
        Gets ``background_work`` when something goes wrong, or works again.
    """

    def __init__(self, name: str, events: EventPublisher) -> None:
        self.name = name
        self._events = events
        self._troubles: dict[str, str] = {}
        self._restarts = 0

    @property
    def lamp(self) -> Lamp | None:
        """Red, with the reasons; None while all is well."""
        if not self._troubles:
            return None
        reasons = "; ".join(f"{part}: {reason}" for part, reason in tuple(self._troubles.items()))
        return Lamp(name=self.name, kind="work", health=Health.FAULT, detail=reasons)

    @contextmanager
    def item(self, part: str) -> Iterator[None]:
        """Guard one item of a part of the work; from any thread. Whatever it raises ends no more than the item."""
        try:
            yield
        except Exception as error:  # noqa: BLE001  an unknown error must not end the loop
            self.fail(part, error)
        else:
            self._restarts = 0
            for mended in (part, _LOOP):
                if self._troubles.pop(mended, None) is not None:
                    self._tell(mended, None)

    def fail(self, part: str, error: Exception) -> None:
        """Take note of an error; the same one again is no news."""
        reason = told(error)
        if self._troubles.get(part) != reason:
            _LOG.error("%s, %s", self.name, part, exc_info=error)
            self._troubles[part] = reason
            self._tell(part, reason)

    async def keep(self, work: "Work") -> None:
        """Do the work until it is done or cancelled; after an error anew, with a pause that doubles from 1 to 60 s."""
        while True:
            try:
                await work(self)
                return
            except Exception as error:  # noqa: BLE001  the top of a task
                self.fail(_LOOP, error)
            await pause(min(FIRST_PAUSE_S * 2**self._restarts, LONGEST_PAUSE_S))
            self._restarts = min(self._restarts + 1, 10)

    def _tell(self, part: str, reason: str | None) -> None:
        self._events.publish("background_work", work=self.name, part=part, error=reason)


Work = Callable[[Duty], Coroutine[Any, Any, None]]
"""A loop that guards its items by the duty that keeps it going."""


async def pause(period_s: float) -> None:
    """Let the event loop do other things for a while: the pace of a loop, never a wait for something."""
    await asyncio.sleep(period_s)
