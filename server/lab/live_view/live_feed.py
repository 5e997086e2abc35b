"""LiveFeed: the newest shot of a run or a live view, as a small JPEG of every exposure that somebody looks at.

One message is one byte, the number of the view; two bytes, most significant first, the length of the caption; the
caption in JSON, ``LiveCaption`` and the ``Tile`` that was wished for; and a JPEG. A reader that is slow misses pictures
and never holds up another one: what is sent next is the newest. What nobody looks at costs nothing; of what several
readers look at, one picture is made.
"""

import asyncio
import json
import time
from collections.abc import AsyncGenerator, Callable, Mapping
from dataclasses import dataclass
from itertools import count
from typing import Annotated, Any, Literal

from pydantic import Field

from daq.devices import Camera
from daq.frozen_model import FrozenModel
from daq.shot import DoubleFrame, Image, Shot
from server.lab.duty import Duty, pause
from server.lab.errors import NotFound
from server.pictures.exposure_figures import ExposureFigures, exposure_figures
from server.pictures.pictures import Stretch, preview_jpeg

_PERIOD_S = 0.05
"""Of looking for a new shot: half of the shortest period of a live view."""
_WIDTH_PX = 560

ExposureName = Literal["a", "b"]


class Tile(FrozenModel):
    """What a reader wants to see of a view."""

    exposure: Annotated[ExposureName, Field(description="first or second; of single exposures there is a alone")] = "b"
    scale: Annotated[Stretch, Field(description="full: grey values as they are; auto: stretched")] = Stretch.FULL


class LiveCaption(FrozenModel):
    """What is said of the newest shot of one view."""

    shot: Annotated[int, Field(description="number of the shot in its run or live view, from 0")]
    age_s: Annotated[float, Field(description="time since it was fired")]
    exposures: Annotated[
        dict[ExposureName, ExposureFigures | None],
        Field(description="light of exposures a and b; null: the exposure is missing"),
    ]


@dataclass(frozen=True)
class LivePicture:
    """One picture of one view.

    Parameters
    ----------
    number : int
        Grows with every picture.
    fired_ns : int
        Unix time of its shot.
    caption : dict
        ``LiveCaption`` and ``Tile``, but for the age.
    jpeg : bytes
        The picture.
    """

    number: int
    fired_ns: int
    caption: dict[str, Any]
    jpeg: bytes

    def message(self, view: int) -> bytes:
        """The same for a reader, as old as it is now."""
        caption = json.dumps(self.caption | {"age_s": _age_s(self.fired_ns)}, separators=(",", ":")).encode()
        return bytes([view]) + len(caption).to_bytes(2, "big") + caption + self.jpeg


class LiveReader:
    """Somebody who looks.

    Parameters
    ----------
    tiles : Mapping[str, Tile]
        What is wanted at first, by view.
    """

    def __init__(self, tiles: Mapping[str, Tile]) -> None:
        self.tiles = dict(tiles)
        self._sent: dict[str, int] = {}

    def next_of(self, pictures: Mapping[tuple[str, Tile], LivePicture], view: str) -> LivePicture | None:
        """The picture of a view that is to be sent; None while the last one is still right."""
        picture = pictures.get((view, self.tiles[view])) if view in self.tiles else None
        if picture is None or self._sent.get(view) == picture.number:
            return None
        self._sent[view] = picture.number
        return picture


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
        self._tried: set[tuple[str, Tile]] = set()
        self._captions: dict[str, LiveCaption] = {}
        self._pictures: dict[tuple[str, Tile], LivePicture] = {}
        self._numbers = count(1)
        self._readers: set[LiveReader] = set()
        self._wanted = asyncio.Event()
        self._tick = asyncio.Event()

    async def run(self, duty: Duty) -> None:
        """Encode new shots until cancelled."""
        while True:
            await self._wanted.wait()
            self._look()
            shot, wishes = self._newest_shot(), self._wishes
            if shot is not None and (shot is not self._encoded or not wishes <= self._tried):
                await asyncio.to_thread(self._encode, shot, wishes, duty)
                self._wake()
            await pause(_PERIOD_S)

    def reader(self) -> LiveReader:
        """Somebody who wants to see all views; tell ``wish`` what else."""
        return LiveReader(dict.fromkeys(self._cameras, Tile()))

    def wish(self, reader: LiveReader, tiles: Mapping[str, Tile]) -> None:
        """From now on this is what a reader wants; a view that is not named, or unknown, costs nothing."""
        reader.tiles = {view: tile for view, tile in tiles.items() if view in self._cameras}
        self._mark_wanted()
        self._wake()

    async def pictures(self, reader: LiveReader | None = None) -> AsyncGenerator[bytes, None]:
        """Give the newest picture of every tile, then new ones, until closed; one message each."""
        reader = reader or self.reader()
        self._readers.add(reader)
        self._mark_wanted()
        try:
            while True:
                tick = self._tick
                for number, view in enumerate(self._cameras):
                    if picture := reader.next_of(self._pictures, view):
                        yield picture.message(number)
                await tick.wait()
        finally:
            self._readers.discard(reader)
            self._mark_wanted()

    def captions(self) -> dict[str, LiveCaption]:
        """What is to be said of the newest shot, by view; empty before the first."""
        shot = self._newest_shot()
        if shot is None:
            return {}
        return {view: self._caption(view, shot) for view in shot.views}

    def image(self, view: str, exposure: ExposureName) -> Image:
        """An exposure of the newest shot that was taken or shown; NotFound before the first, or if it is missing."""
        shot = self._newest_shot() or self._encoded
        image = exposures_of(shot.views[view]).get(exposure) if shot is not None and view in shot.views else None
        if image is None:
            raise NotFound(f"there is no exposure {exposure} of {view!r} now: show the rig live, or shoot one")
        return image

    @property
    def _wishes(self) -> set[tuple[str, Tile]]:
        return {wish for reader in self._readers for wish in reader.tiles.items()}

    def _mark_wanted(self) -> None:
        if self._wishes:
            self._wanted.set()
        else:
            self._wanted.clear()

    def _wake(self) -> None:
        tick, self._tick = self._tick, asyncio.Event()
        tick.set()

    def _encode(self, shot: Shot, wishes: set[tuple[str, Tile]], duty: Duty) -> None:
        """Make the pictures that are wished for of a shot, once; what nobody wishes for any more is forgotten."""
        is_new = shot is not self._encoded
        self._encoded, self._tried, old = shot, wishes, {} if is_new else self._pictures
        captions = {} if is_new else self._captions
        made: dict[tuple[str, Tile], LivePicture] = {}
        for view, tile in wishes:
            with duty.item(view):
                if view not in captions:
                    captions[view] = self._caption(view, shot)
                made[view, tile] = old.get((view, tile)) or self._picture(shot, view, tile, captions[view])
        self._captions, self._pictures = captions, made

    def _picture(self, shot: Shot, view: str, tile: Tile, caption: LiveCaption) -> LivePicture:
        image = _shown(shot.views[view], tile.exposure)
        jpeg = preview_jpeg(image, self._cameras[view].bits, tile.scale, _WIDTH_PX)
        told = caption.model_dump(mode="json") | {"tile": tile.model_dump(mode="json")}
        return LivePicture(next(self._numbers), shot.host_time_ns, told, jpeg)

    def _caption(self, view: str, shot: Shot) -> LiveCaption:
        bits, exposures = self._cameras[view].bits, exposures_of(shot.views[view])
        figures = {name: None if image is None else exposure_figures(image, bits) for name, image in exposures.items()}
        return LiveCaption(shot=shot.index, age_s=_age_s(shot.host_time_ns), exposures=figures)


def exposures_of(frames: DoubleFrame) -> dict[ExposureName, Image | None]:
    """The exposures that a camera takes; None for a missing one."""
    taken: dict[ExposureName, Image | None] = {"a": frames.frame_a if frames.record_a.valid else None}
    if frames.frame_b is not None:
        taken["b"] = frames.frame_b if frames.record_b.valid else None
    return taken


def _shown(frames: DoubleFrame, exposure: ExposureName) -> Image:
    """What stands in the slot of an exposure: zeros where it is missing; A where the camera takes single exposures."""
    return frames.frame_b if exposure == "b" and frames.frame_b is not None else frames.frame_a


def _age_s(fired_ns: int) -> float:
    return round((time.time_ns() - fired_ns) / 1e9, 2)
