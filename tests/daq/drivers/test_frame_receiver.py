from collections.abc import Iterator
from queue import Empty, Queue

import numpy as np
import pytest

from daq.drivers.exposure_pairing import Arrival
from daq.drivers.frame_receiver import FrameReceiver, StreamCounters
from daq.errors import DeviceError


class Frames:
    """A stream that delivers what is put into it."""

    def __init__(self) -> None:
        self.queue: Queue[Arrival] = Queue()
        self.closed = False

    def pop(self) -> Arrival | None:
        try:
            return self.queue.get(timeout=0.01)
        except Empty:
            return None

    def close(self) -> None:
        self.closed = True


def whole(frame_id: int, stamp_ns: int) -> Arrival:
    return Arrival(frame_id, stamp_ns, np.full((2, 2), frame_id % 256, np.uint8))


def incomplete(frame_id: int, missing_packets: int) -> Arrival:
    return Arrival(frame_id, 0, None, missing_packets)


@pytest.fixture
def frames() -> Frames:
    return Frames()


@pytest.fixture
def receiver(frames: Frames) -> Iterator[FrameReceiver]:
    receiver = FrameReceiver("view", frames)
    receiver.start()
    yield receiver
    receiver.stop()
    assert frames.closed


def ids(receiver: FrameReceiver, frames: int, deadline_s: float = 1.0) -> list[int]:
    return [arrival.frame_id for arrival in receiver.take(frames, deadline_s)]


class Broken(Frames):
    """A stream whose second frame cannot be taken out."""

    def pop(self) -> Arrival | None:
        arrival = super().pop()
        if arrival is not None and arrival.frame_id == 2:
            raise AttributeError("BufferStatus has no attribute SUCCESS")
        return arrival


def test_a_thread_that_dies_is_told_at_once_and_its_stream_is_closed() -> None:
    frames = Broken()
    receiver = FrameReceiver("view2", frames)
    receiver.start()
    for frame_id in (1, 2):
        frames.queue.put(whole(frame_id, 100))
    with pytest.raises(DeviceError, match=r"view2: its frames are received no more: AttributeError\('BufferStatus"):
        receiver.take(2, 30.0)
    receiver.stop()
    assert frames.closed


def test_hands_frames_out_once_and_in_order(frames: Frames, receiver: FrameReceiver) -> None:
    for frame_id in (1, 2):
        frames.queue.put(whole(frame_id, 100))
    assert ids(receiver, 2) == [1, 2]
    assert ids(receiver, 1, 0.05) == []


def test_gives_what_there_is_at_the_deadline(frames: Frames, receiver: FrameReceiver) -> None:
    frames.queue.put(whole(1, 100))
    assert ids(receiver, 2, 0.1) == [1]


def test_frames_older_than_the_shot_are_left_out(frames: Frames, receiver: FrameReceiver) -> None:
    receiver.open_shot(1000)
    for arrival in (whole(1, 998), whole(2, 999), whole(3, 1000), whole(4, 1001)):
        frames.queue.put(arrival)
    assert ids(receiver, 2) == [3, 4]
    assert receiver.counters.stale_frames == 2


def test_an_incomplete_frame_is_as_old_as_its_successor(frames: Frames, receiver: FrameReceiver) -> None:
    receiver.open_shot(1000)
    for arrival in (incomplete(1, 5), whole(2, 999), whole(3, 1000), incomplete(4, 2)):
        frames.queue.put(arrival)
    assert ids(receiver, 3, 0.1) == [3, 4]


def test_counts_gaps_in_the_frame_ids_across_the_wrap(frames: Frames, receiver: FrameReceiver) -> None:
    for arrival in (whole(65533, 1), whole(65534, 2), incomplete(2, 7)):
        frames.queue.put(arrival)
    receiver.take(3, 1.0)
    assert receiver.counters == StreamCounters(frames=3, missing_frames=2, missing_packets=7)


def test_a_frame_that_was_overtaken_is_no_gap(frames: Frames, receiver: FrameReceiver) -> None:
    for arrival in (whole(65534, 1), whole(1, 3), incomplete(65535, 7), whole(2, 4)):
        frames.queue.put(arrival)
    receiver.take(4, 1.0)
    assert receiver.counters == StreamCounters(frames=4, missing_frames=1, missing_packets=7)
