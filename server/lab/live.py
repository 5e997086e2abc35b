"""LiveFeed: the newest exposure of every camera as small JPEGs.

One message is one byte, the number of the view, and a JPEG. A reader that is slow misses pictures and never holds up
another one. Nothing is encoded while nobody looks.
"""

import asyncio
from collections.abc import AsyncGenerator, Mapping
from dataclasses import dataclass

from daq.devices import Camera
from daq.shot import Image
from server.lab.duty import Duty, pause
from server.pictures.pictures import preview_jpeg

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

    async def run(self, duty: Duty) -> None:
        """Encode new exposures until cancelled."""
        while True:
            await self._wanted.wait()
            await asyncio.to_thread(self._encode_new_exposures, duty)
            tick, self._tick = self._tick, asyncio.Event()
            tick.set()
            await pause(_PERIOD_S)

    async def pictures(self) -> AsyncGenerator[bytes, None]:
        """Give the newest picture of every view, then new ones, until closed; one message each."""
        self._readers += 1
        self._wanted.set()
        try:
            sent = [0] * len(self._cameras)
            while True:
                tick = self._tick
                for view, picture in enumerate(list(self._pictures)):
                    if picture.number > sent[view]:
                        yield picture.message
                        sent[view] = picture.number
                await tick.wait()
        finally:
            self._readers -= 1
            if self._readers == 0:
                self._wanted.clear()

    def _encode_new_exposures(self, duty: Duty) -> None:
        for view, camera in enumerate(self._cameras):
            with duty.item(camera.name):
                self._encode_new_exposure(view, camera)

    def _encode_new_exposure(self, view: int, camera: Camera) -> None:
        exposure = camera.latest()
        if exposure is not None and exposure is not self._exposures[view]:
            jpeg = preview_jpeg(exposure, camera.bits, _WIDTH_PX)
            self._pictures[view] = LivePicture(self._pictures[view].number + 1, bytes([view]) + jpeg)
            self._exposures[view] = exposure
