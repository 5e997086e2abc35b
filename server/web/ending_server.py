"""EndingServer: a server that ends as soon as it is told to, from any thread."""

import asyncio
from contextlib import suppress

import uvicorn

_TICK_S = 1.0
"""So often the date of answers is renewed."""


class EndingServer(uvicorn.Server):
    """What uvicorn serves, which itself looks ten times a second whether it is to end."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._told = asyncio.Event()

    def end(self) -> None:
        """End it, now or as soon as it has begun; nobody waits for that here."""
        self.should_exit = True
        if self._loop is not None:
            with suppress(RuntimeError):  # it is over
                self._loop.call_soon_threadsafe(self._told.set)

    async def main_loop(self) -> None:
        """Serve until told to end."""
        self._loop = asyncio.get_running_loop()
        while not await self.on_tick(0):
            with suppress(TimeoutError):
                async with asyncio.timeout(_TICK_S):
                    await self._told.wait()
