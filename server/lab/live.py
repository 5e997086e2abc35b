"""LiveFeed: the newest exposure of every camera as small JPEGs, over one websocket per page.

One message is one byte, the number of the view, and a JPEG. A reader that is slow misses pictures and never holds up
another one. Nothing is encoded while nobody looks.
"""

import asyncio
import contextlib
from collections.abc import Mapping
from dataclasses import dataclass

from fastapi import WebSocket, WebSocketDisconnect

from daq.devices import Camera
from daq.shot import Image
from server.pictures.pictures import preview_jpeg

LIVE_PATH = "/api/live"
_PERIOD_S = 0.1
_WIDTH_PX = 560


@dataclass(frozen=True)
class LivePicture:
    """One picture of one view; ``number`` grows with every new exposure."""

    number: int
    message: bytes


class LiveFeed:
    """Encodes and distributes pictures.

    Parameters
    ----------
    cameras : Mapping[str, Camera]
        Cameras by view; opened.
    """

    def __init__(self, cameras: Mapping[str, Camera]) -> None:
        self._cameras = tuple(cameras.values())
        self._exposures: list[Image | None] = [None] * len(cameras)
        self._pictures = [LivePicture(0, b"")] * len(cameras)
        self._readers = 0
        self._wanted = asyncio.Event()
        self._tick = asyncio.Event()

    async def run(self) -> None:
        """Encode new exposures until cancelled."""
        while True:
            await self._wanted.wait()
            await asyncio.to_thread(self._encode_new_exposures)
            tick, self._tick = self._tick, asyncio.Event()
            tick.set()
            await pause(_PERIOD_S)

    async def serve(self, socket: WebSocket) -> None:
        """Send pictures to one page until it leaves."""
        await socket.accept()
        self._readers += 1
        self._wanted.set()
        try:
            await self._send_until_closed(socket)
        finally:
            self._readers -= 1
            if self._readers == 0:
                self._wanted.clear()

    async def _send_until_closed(self, socket: WebSocket) -> None:
        closed = asyncio.create_task(_closed(socket))
        sent = [0] * len(self._cameras)
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):  # the page left while we were sending
            while not closed.done():
                for view, picture in enumerate(list(self._pictures)):
                    if picture.number > sent[view]:
                        await socket.send_bytes(picture.message)
                        sent[view] = picture.number
                tick = asyncio.create_task(self._tick.wait())
                await asyncio.wait([tick, closed], return_when=asyncio.FIRST_COMPLETED)
                tick.cancel()
        closed.cancel()

    def _encode_new_exposures(self) -> None:
        for view, camera in enumerate(self._cameras):
            exposure = camera.latest()
            if exposure is not None and exposure is not self._exposures[view]:
                self._exposures[view] = exposure
                jpeg = preview_jpeg(exposure, camera.bits, _WIDTH_PX)
                self._pictures[view] = LivePicture(self._pictures[view].number + 1, bytes([view]) + jpeg)


async def pause(period_s: float) -> None:
    """Let the event loop do other things for a while: the pace of a loop, never a wait for something."""
    await asyncio.sleep(period_s)


async def _closed(socket: WebSocket) -> None:
    """Wait until the page has closed its end; what it says before is nothing to us."""
    while (await socket.receive())["type"] != "websocket.disconnect":
        continue
