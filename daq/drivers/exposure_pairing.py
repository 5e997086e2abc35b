"""Which frames are exposures A and B of a firing. Pure: arrivals in, a DoubleFrame out.

A camera can miss a trigger or lose a frame without a word, and from then on every frame id is one off.
So ids are compared with the end of the last complete shot only, and nothing is taken on trust: an exposure
whose place cannot be proven is discarded, and its slot is flagged.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from daq.drivers.camera_profile import PairSpacing
from daq.shot import DoubleFrame, ExposureRecord, Flaw, Image

_FRAME_IDS = 65535


@dataclass(frozen=True)
class Arrival:
    """One frame that came out of the stream.

    Parameters
    ----------
    frame_id : int
        1 to 65535.
    device_timestamp_ns : int
        Camera clock; 0 where the frame is incomplete.
    image : Image | None
        Grey values, (row, column); None where packets are missing or the size is wrong.
    missing_packets, resent_packets : int
        What the stream counted since the frame before.
    wrong_size : bool
        It is whole, but has other rows or columns than it should.
    """

    frame_id: int
    device_timestamp_ns: int
    image: Image | None
    missing_packets: int = 0
    resent_packets: int = 0
    wrong_size: bool = False

    def record(self, flaw: Flaw = Flaw.NONE) -> ExposureRecord:
        """What the shot file keeps of it."""
        counted = (self.frame_id, self.device_timestamp_ns, self.missing_packets, self.resent_packets)
        return ExposureRecord(flaw is Flaw.NONE, *counted, flaw=flaw)


@dataclass(frozen=True)
class ExposureFormat:
    """What a shot of this camera must consist of.

    Parameters
    ----------
    shape : tuple[int, int]
        (rows, columns) of one exposure.
    bits : int
        Significant bits of a grey value: 8 to 16.
    frames : int
        Exposures per trigger, 1 or 2.
    pair : PairSpacing | None
        Device time between A and B, where the camera's stamps tell it.
    stacked : bool
        A and B come as one frame, A above B.
    """

    shape: tuple[int, int]
    bits: int
    frames: int
    pair: PairSpacing | None
    stacked: bool = False

    @property
    def arrivals(self) -> int:
        """Frames per trigger as they come out of the stream."""
        return 1 if self.stacked else self.frames

    @property
    def arrival_shape(self) -> tuple[int, int]:
        """(rows, columns) of such a frame."""
        rows, columns = self.shape
        return (self.frames * rows if self.stacked else rows), columns

    def image_of(self, memory: NDArray[np.uint8]) -> Image:
        """Copy of the frame that lies in these bytes."""
        if self.bits == 8:
            return memory.reshape(self.arrival_shape).copy()
        return memory.view(np.uint16).reshape(self.arrival_shape).copy()

    def exposure_of(self, image: Image, index: int) -> Image:
        """Exposure A (0) or B (1) of a frame; the frame itself, unless it holds both."""
        return image.reshape(-1, *self.shape)[index] if self.stacked else image

    def blank(self) -> Image:
        """The image of a missing exposure."""
        return np.zeros(self.shape, np.uint8) if self.bits == 8 else np.zeros(self.shape, np.uint16)


def frame_id_distance(earlier: int, later: int) -> int:
    """Frames from one id to the next; ids count 1 to 65535 and wrap to 1, and 0 stands before the first."""
    return (later - earlier) % _FRAME_IDS


def place_exposures(arrivals: Sequence[Arrival], last_id: int | None, frames: int) -> list[Arrival | None]:
    """Arrivals by slot: A, B.

    Parameters
    ----------
    arrivals : Sequence[Arrival]
        All frames since the firing, in order of arrival.
    last_id : int | None
        Frame id at the end of the shot before; None if that shot was incomplete.
    frames : int
        Number of slots.

    Returns
    -------
    list[Arrival | None]
        One per slot. All None where the frames are too many, are no neighbours, or where a lone frame
        cannot be told from its neighbour.
    """
    nowhere: list[Arrival | None] = [None] * frames
    if len(arrivals) == frames:
        neighbours = all(
            frame_id_distance(first.frame_id, second.frame_id) == 1 for first, second in pairwise(arrivals)
        )
        return list(arrivals) if neighbours else nowhere
    if len(arrivals) != 1 or last_id is None:
        return nowhere
    slot = frame_id_distance(last_id, arrivals[0].frame_id) - 1
    return [arrivals[0] if slot == index else None for index in range(frames)]


def double_frame(arrivals: Sequence[Arrival], last_id: int | None, form: ExposureFormat) -> DoubleFrame:
    """Exposures of one firing; what is missing or unproven is black, and flagged."""
    placed = place_exposures(arrivals, last_id, form.arrivals)
    if form.stacked:
        placed = [_half(placed[0], index, form) for index in range(form.frames)]
    trusted = _is_one_pair(placed, form.pair)
    unplaced = bool(arrivals) and not any(placed)
    images, records = zip(*(_exposure(arrival, trusted, form, unplaced) for arrival in placed), strict=True)
    if form.frames == 1:
        return DoubleFrame(images[0], None, records[0], ExposureRecord(valid=False))
    return DoubleFrame(images[0], images[1], records[0], records[1])


def _half(both: Arrival | None, index: int, form: ExposureFormat) -> Arrival | None:
    if both is None or both.image is None:
        return both
    return replace(both, image=form.exposure_of(both.image, index))


def _is_one_pair(placed: Sequence[Arrival | None], pair: PairSpacing | None) -> bool:
    stamps = [arrival.device_timestamp_ns for arrival in placed if arrival is not None and arrival.image is not None]
    if len(stamps) < 2:
        return True
    spacing_ns = stamps[1] - stamps[0]
    if pair is None:
        return spacing_ns >= 0
    return abs(spacing_ns - pair.spacing_ns) <= pair.tolerance_ns


def _exposure(
    arrival: Arrival | None, trusted: bool, form: ExposureFormat, unplaced: bool
) -> tuple[Image, ExposureRecord]:
    if arrival is None:
        return form.blank(), ExposureRecord(valid=False, flaw=Flaw.UNPROVEN if unplaced else Flaw.LOST)
    if arrival.image is None:
        return form.blank(), arrival.record(Flaw.WRONG_SIZE if arrival.wrong_size else Flaw.INCOMPLETE)
    if not trusted:
        return form.blank(), arrival.record(Flaw.UNPROVEN)
    return arrival.image, arrival.record()
