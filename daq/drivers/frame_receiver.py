"""The polling thread of a camera: takes frames out of its stream and keeps those of the present firing."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from threading import Condition, Event, Thread
from typing import Protocol

from daq.drivers.exposure_pairing import Arrival, frame_id_distance
from daq.errors import DeviceError

_FARTHEST = 32767
"""Ids wrap: what seems farther ahead than half of them lies behind."""


@dataclass(frozen=True)
class StreamCounters:
    """What the stream of a camera has done since it was armed.

    Parameters
    ----------
    frames : int
        Frames received, incomplete ones included.
    missing_frames : int
        Gaps in the frame ids.
    stale_frames : int
        Frames older than the firing they came after.
    missing_packets, resent_packets : int
        Network packets that never came, and that came on the second request.
    """

    frames: int = 0
    missing_frames: int = 0
    stale_frames: int = 0
    missing_packets: int = 0
    resent_packets: int = 0


class FrameStream(Protocol):
    """Frames of one acquisition."""

    def pop(self) -> Arrival | None:
        """Wait a fraction of a second for the next frame; None if there was none."""

    def close(self) -> None:
        """End the stream."""


class FrameReceiver:
    """Polls a stream in its own thread.

    Parameters
    ----------
    name : str
        Device name, for the thread.
    stream : FrameStream
        Where frames come from; belongs to the thread, which also closes it.
    """

    def __init__(self, name: str, stream: FrameStream) -> None:
        self._name = name
        self._stream = stream
        self._changed = Condition()
        self._arrivals: list[Arrival] = []
        self._opened_ns = 0
        self._last_id: int | None = None
        self._counters = StreamCounters()
        self._failure: Exception | None = None
        self._stopping = Event()
        self._thread = Thread(target=self._poll, name=f"{name} frames", daemon=True)

    def start(self) -> None:
        """Start polling."""
        self._thread.start()

    def stop(self) -> None:
        """End polling and close the stream."""
        self._stopping.set()
        self._thread.join()

    def open_shot(self, opened_ns: int) -> None:
        """Forget what has come; frames stamped before ``opened_ns`` (camera clock) belong to no later firing."""
        with self._changed:
            self._arrivals.clear()
            self._opened_ns = opened_ns

    def take(self, frames: int, deadline_s: float) -> Sequence[Arrival]:
        """Frames of the firing: as soon as so many are there, at the deadline otherwise. They are handed out once.

        Raises
        ------
        DeviceError
            The thread that polls has died.
        """
        with self._changed:
            self._changed.wait_for(lambda: len(self._arrivals) >= frames or self._failure, deadline_s)
            if self._failure is not None:
                reason = f"its frames are received no more: {self._failure!r}"
                raise DeviceError(self._name, reason) from self._failure
            arrivals, self._arrivals = self._arrivals, []
            return arrivals

    @property
    def arrived(self) -> int:
        """How many frames of the firing wait to be taken."""
        return len(self._arrivals)

    @property
    def counters(self) -> StreamCounters:
        """Counters since arming."""
        return self._counters

    def _poll(self) -> None:
        """Thread; what ends it is told by the next ``take``."""
        try:
            while not self._stopping.is_set():
                arrival = self._stream.pop()
                if arrival is not None:
                    self._take(arrival)
        except Exception as error:  # noqa: BLE001  the top of a thread
            with self._changed:
                self._failure = error
                self._changed.notify_all()
        finally:
            self._stream.close()

    def _take(self, arrival: Arrival) -> None:
        with self._changed:
            stale = arrival.image is not None and arrival.device_timestamp_ns < self._opened_ns
            self._count(arrival, stale)
            if stale:
                self._arrivals.clear()  # frames come in order: whatever came before a stale one is older still
            else:
                self._arrivals.append(arrival)
                self._changed.notify_all()

    def _count(self, arrival: Arrival, stale: bool) -> None:
        distance = 1 if self._last_id is None else frame_id_distance(self._last_id, arrival.frame_id)
        overtaken = distance > _FARTHEST  # a frame that stayed incomplete is given up after later ones have come
        gap = 0 if overtaken else distance - 1
        self._last_id = self._last_id if overtaken else arrival.frame_id
        self._counters = replace(
            self._counters,
            frames=self._counters.frames + 1,
            missing_frames=self._counters.missing_frames + max(0, gap),
            stale_frames=self._counters.stale_frames + stale,
            missing_packets=self._counters.missing_packets + arrival.missing_packets,
            resent_packets=self._counters.resent_packets + arrival.resent_packets,
        )
