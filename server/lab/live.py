"""LiveFeed: the newest shot of a run or a live view, as one small JPEG of every view and what is to be said of it.

One message is one byte, the number of the view; two bytes, most significant first, the length of the caption; the
caption, ``LiveCaption`` in JSON; and a JPEG. A reader that is slow misses pictures and never holds up another one.
Nothing is encoded while nobody looks.
"""

import asyncio
import time
from collections.abc import AsyncGenerator, Callable, Mapping
from dataclasses import dataclass, field
from typing import Annotated

from pydantic import Field

from daq.devices import Camera
from daq.frozen_model import FrozenModel
from daq.shot import DoubleFrame, Image, Shot
from server.lab.duty import Duty, pause
from server.pictures.exposure_level import ExposureLevel, exposure_level
from server.pictures.pictures import preview_jpeg

_PERIOD_S = 0.1
_WIDTH_PX = 560


class LiveCaption(FrozenModel):
    """What is said of the newest shot of one view."""

    shot: Annotated[int, Field(description="number of the shot in its run or live view, from 0")]
    age_s: Annotated[float, Field(description="time since it was fired")]
    exposures: Annotated[
        dict[str, ExposureLevel | None], Field(description="light of exposures a and b; null: the exposure is missing")
    ]


@dataclass(frozen=True)
class LivePicture:
    """One picture of one view; ``number`` grows with every new shot."""

    number: int = 0
    fired_ns: int = 0
    caption: LiveCaption = field(default_factory=lambda: LiveCaption(shot=0, age_s=0.0, exposures={}))
    jpeg: bytes = b""

    def message(self, view: int) -> bytes:
        """The same for a reader, as old as it is now."""
        caption = _aged(self.caption, self.fired_ns).model_dump_json().encode()
        return bytes([view]) + len(caption).to_bytes(2, "big") + caption + self.jpeg


class LiveFeed:
    """Encodes and distributes pictures.

    Parameters
    ----------
    cameras : Mapping[str, Camera]
        Cameras by view.
    newest_shot : Callable[[], Shot | None]
        Asked for the newest shot.
    look : Callable[[], None]
        Told again and again while somebody looks.
    """

    def __init__(
        self, cameras: Mapping[str, Camera], newest_shot: Callable[[], Shot | None], look: Callable[[], None]
    ) -> None:
        self._cameras = dict(cameras)
        self._newest_shot = newest_shot
        self._look = look
        self._encoded: Shot | None = None
        self._pictures = [LivePicture()] * len(cameras)
        self._readers = 0
        self._wanted = asyncio.Event()
        self._tick = asyncio.Event()

    async def run(self, duty: Duty) -> None:
        """Encode new shots until cancelled."""
        while True:
            await self._wanted.wait()
            self._look()
            await asyncio.to_thread(self._encode_newest, duty)
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
                        yield picture.message(view)
                        sent[view] = picture.number
                await tick.wait()
        finally:
            self._readers -= 1
            if self._readers == 0:
                self._wanted.clear()

    def captions(self) -> dict[str, LiveCaption]:
        """What is to be said of the newest shot, by view; empty before the first."""
        shot = self._newest_shot()
        if shot is None:
            return {}
        return {view: _aged(self._caption(view, shot), shot.host_time_ns) for view in shot.views}

    def _encode_newest(self, duty: Duty) -> None:
        shot = self._newest_shot()
        if shot is None or shot is self._encoded:
            return
        self._encoded = shot
        for number, view in enumerate(self._cameras):
            with duty.item(view):
                jpeg = preview_jpeg(_shown(shot.views[view]), self._cameras[view].bits, _WIDTH_PX)
                caption = self._caption(view, shot)
                self._pictures[number] = LivePicture(
                    self._pictures[number].number + 1, shot.host_time_ns, caption, jpeg
                )

    def _caption(self, view: str, shot: Shot) -> LiveCaption:
        return LiveCaption(shot=shot.index, age_s=0.0, exposures=_levels(shot.views[view], self._cameras[view].bits))


def _shown(frames: DoubleFrame) -> Image:
    """Exposure B, which also sees the light of the room; A where B is missing."""
    return frames.frame_b if frames.frame_b is not None and frames.record_b.valid else frames.frame_a


def _levels(frames: DoubleFrame, bits: int) -> dict[str, ExposureLevel | None]:
    exposures = {"a": (frames.frame_a, frames.record_a), "b": (frames.frame_b, frames.record_b)}
    return {
        name: exposure_level(image, bits) if record.valid else None
        for name, (image, record) in exposures.items()
        if image is not None
    }


def _aged(caption: LiveCaption, fired_ns: int) -> LiveCaption:
    return caption.model_copy(update={"age_s": round((time.time_ns() - fired_ns) / 1e9, 2)})
