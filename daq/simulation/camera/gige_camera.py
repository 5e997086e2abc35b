"""A double-frame camera on the wire: GigE Vision device on a loopback address, triggered by the fired pulse train.

Two threads: one answers the control channel, one exposes and streams. The scene is asked for the
exposures that the camera's own timing model cuts out of the pulse train that was really fired.
"""

import socket
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from threading import Condition, Event, Lock, Thread
from time import monotonic, monotonic_ns
from types import TracebackType
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from daq.shot import FiredTrain, Image
from daq.simulation.camera.gige_control import GVCP_PORT, ControlChannel
from daq.simulation.camera.gige_faults import CameraFaults, ShotFault
from daq.simulation.camera.gige_registers import (
    LATCH_TIMESTAMP,
    STREAM_PACKET_SIZE_MASK,
    TICK_FREQUENCY_HZ,
    Register,
    RegisterBank,
    TriggerSource,
)
from daq.simulation.camera.gige_stream import Block, StreamChannel, last_block_id, next_block_id
from daq.simulation.camera.gige_xml import camera_xml
from daq.simulation.camera.light import Exposure, FrameSource, exposures_of
from daq.timing import CameraTiming

_CONTROL_POLL_S = 0.2
_WAKE_UP = b""
_FIRINGS_BUFFERED = 2
_POWER_ON_NS = 1_000_000_000
_DROPS: dict[Literal["A", "B"], ShotFault] = {"A": "dropped_a", "B": "dropped_b"}


@dataclass(frozen=True)
class _Firing:
    """A pulse train whose trigger edge the camera took, its zero by host and camera, and the acquisition it is of."""

    train: FiredTrain
    zero_ns: int
    stamp_ns: int
    acquisition: int


@dataclass(frozen=True)
class _Delivery:
    """A block, and the host time at which it has been read out and may leave."""

    block: Block
    ready_ns: int


class SimulatedCamera:
    """GigE Vision double-frame camera; a context manager.

    Parameters
    ----------
    view : str
        View whose trigger edge and light pulses it sees.
    ip : str
        Loopback address it answers on, for example ``127.0.0.31``.
    serial : str
        Serial number, at most 15 characters.
    timing : CameraTiming
        When its exposures open and close after a trigger edge, and how long it is busy.
    frame_source : FrameSource
        Renders an exposure; called in the camera's own thread, and may take its time.
    shape : tuple[int, int]
        (rows, columns) of the sensor.
    link_bits_per_s : float
        Rate at which packets leave.

    Attributes
    ----------
    faults : CameraFaults
        What goes wrong, at present all well.
    """

    def __init__(
        self,
        view: str,
        ip: str,
        serial: str,
        timing: CameraTiming,
        frame_source: FrameSource,
        shape: tuple[int, int] = (1200, 1600),
        link_bits_per_s: float = 1e9,
    ) -> None:
        self.faults = CameraFaults()
        self._view = view
        self._ip = ip
        self._timing = timing
        self._frame_source = frame_source
        self._factory_settings = partial(RegisterBank, ip, serial, shape, timing.exposure_a_ns, camera_xml(shape))
        self._bank = self._factory_settings()
        self._link_bits_per_s = link_bits_per_s
        self._changed = Condition()
        self._pending: deque[_Firing] = deque()
        self._busy_until_ns = 0
        self._acquisition = 0
        self._block_id = 0
        self._lost_triggers = 0
        self._stopping = Event()
        self._switching = Lock()
        self._threads: tuple[Thread, ...] = ()

    def __enter__(self) -> Self:
        self.power_on()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.kill()

    @property
    def lost_triggers(self) -> int:
        """Trigger edges that came while the camera was busy or not armed."""
        return self._lost_triggers

    def power_on(self) -> None:
        """Give it power: factory settings, a clock that starts anew, and nobody who controls it."""
        with self._switching:
            if not self._threads:
                self._boot()

    def kill(self) -> None:
        """Pull the plug: the address answers no more."""
        with self._switching:
            if self._threads:
                self._die()

    def _boot(self) -> None:
        self._stopping.clear()
        self._pending.clear()
        self._busy_until_ns = 0
        self.faults.forget_what_power_ends()
        self._bank = self._factory_settings()
        self._power_on_ns = monotonic_ns() - _POWER_ON_NS
        self._control_socket = self._bind(GVCP_PORT)
        self._stream_socket = self._bind(0)
        self._bank[Register.STREAM_SOURCE_PORT] = self._stream_socket.getsockname()[1]
        self._stream = StreamChannel(self._stream_socket, self._link_bits_per_s, self.faults, self._stopping)
        self._control = ControlChannel(self._bank, self._on_write, self._stream.resend)
        self._threads = tuple(
            Thread(target=target, name=f"{self._view} {target.__name__}", daemon=True)
            for target in (self._answer_requests, self._stream_firings)
        )
        for thread in self._threads:
            thread.start()

    def _die(self) -> None:
        self._stopping.set()
        with self._changed:
            self._changed.notify_all()
        self._stream_socket.sendto(_WAKE_UP, self._control_socket.getsockname())
        for thread in self._threads:
            thread.join()
        self._control_socket.close()
        self._stream_socket.close()
        self._threads = ()

    def trigger(self, train: FiredTrain) -> None:
        """An edge on the trigger line; returns at once. Lost if the camera is busy or not armed, as in reality."""
        zero_ns = monotonic_ns()
        delay_ns = train.camera_trigger_ns.get(self._view)
        if delay_ns is None or self.faults.frozen or self.faults.take("missed_triggers"):
            return
        with self._changed:
            if not self._accepts_trigger(zero_ns + delay_ns):
                self._lost_triggers += 1
                return
            self._busy_until_ns = zero_ns + delay_ns + self._timing.cycle_ns
            self._pending.append(_Firing(train, zero_ns, self._device_ns(zero_ns), self._acquisition))
            self._changed.notify_all()

    def _accepts_trigger(self, edge_ns: int) -> bool:
        armed = (
            self._bank[Register.ACQUISITION]
            and self._bank[Register.TRIGGER_MODE]
            and self._bank[Register.TRIGGER_SOURCE] == TriggerSource.Line1
        )
        return bool(armed) and edge_ns >= self._busy_until_ns and len(self._pending) < _FIRINGS_BUFFERED

    def _bind(self, port: int) -> socket.socket:
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        sock.settimeout(_CONTROL_POLL_S)
        sock.bind((self._ip, port))
        return sock

    def _answer_requests(self) -> None:
        while not self._stopping.is_set():
            try:
                request, peer = self._control_socket.recvfrom(2048)
            except TimeoutError:
                request, peer = b"", ("", 0)
            if self.faults.frozen:
                continue
            now_s = monotonic()
            self._control.hand_over(self.faults.held_by_another)
            self._control.expire(now_s)
            answer = self._control.answer(request, peer, now_s)
            if answer is not None:
                self._control_socket.sendto(answer, peer)

    def _on_write(self, address: int, value: int) -> None:
        if address == Register.TIMESTAMP_CONTROL and value == LATCH_TIMESTAMP:
            self._bank.latch_timestamp(self._device_ns(monotonic_ns()))
        elif address == Register.ACQUISITION:
            self._restart()

    def _restart(self) -> None:
        with self._changed:
            self._acquisition += 1
            self._block_id = last_block_id(self.faults.blocks_before_wrap)
            self._pending.clear()
            self._stream.forget()

    def _device_ns(self, host_ns: int) -> int:
        return max(0, host_ns - self._power_on_ns + self.faults.timestamp_jump_ns)

    def _stream_firings(self) -> None:
        while (firing := self._next_firing()) is not None:
            size = (self._bank.image_shape, self._bank.pixel_format.bits)
            exposures = exposures_of(firing.train, self._view, self._timing, *size)[: self._bank.frames_per_trigger]
            images = [self._frame_source(exposure) for exposure in exposures]
            if self._bank.is_stacked:
                exposures, images = exposures[-1:], [_stacked(images)]
            if self.faults.take("late"):
                self._stopping.wait(self.faults.late_s)
            for delivery in self._deliveries(firing, exposures, images):
                self._send(firing, delivery)

    def _next_firing(self) -> _Firing | None:
        with self._changed:
            self._changed.wait_for(lambda: self._stopping.is_set() or bool(self._pending))
            return None if self._stopping.is_set() else self._pending.popleft()

    def _deliveries(
        self, firing: _Firing, exposures: Sequence[Exposure], images: Sequence[Image]
    ) -> Sequence[_Delivery]:
        if self.faults.take("wrong_size"):
            images = [image[: len(image) // 2] for image in images]
        dropped = [frame for frame, fault in _DROPS.items() if self.faults.take(fault)]
        deliveries = [
            self._delivery(firing, block_id, exposure, image)
            for block_id, exposure, image in zip(self._claim_ids(firing, exposures), exposures, images, strict=False)
            if exposure.frame not in dropped
        ]
        deliveries = deliveries[::-1] if self.faults.take("swapped") else deliveries
        return [one for one in deliveries for _ in range(2)] if self.faults.take("doubled") else deliveries

    def _claim_ids(self, firing: _Firing, exposures: Sequence[Exposure]) -> Sequence[int]:
        """Ids of the blocks; none if the acquisition that the firing belongs to has ended meanwhile."""
        with self._changed:
            if firing.acquisition != self._acquisition:
                return ()
            ids = []
            for _ in exposures:
                self._block_id = next_block_id(self._block_id)
                ids.append(self._block_id)
            return ids

    def _delivery(self, firing: _Firing, block_id: int, exposure: Exposure, image: Image) -> _Delivery:
        pixel_format = self._bank.pixel_format
        block = Block(
            block_id=block_id,
            timestamp_ns=firing.stamp_ns + exposure.window.open_ns,
            pixel_format=pixel_format,
            shape=(image.shape[0], image.shape[1]),
            payload=pixel_format.encode(image),
            packet_bytes=self._bank[Register.STREAM_PACKET_SIZE] & STREAM_PACKET_SIZE_MASK,
        )
        readout_ns = self._timing.readout_ns if exposure.frame == "B" else self._timing.exposure_b_ns
        return _Delivery(block, firing.zero_ns + exposure.window.close_ns + readout_ns)

    def _send(self, firing: _Firing, delivery: _Delivery) -> None:
        self._stopping.wait(max(0, delivery.ready_ns - monotonic_ns()) / 1e9)
        address = self._bank[Register.STREAM_ADDRESS].to_bytes(4)
        port = self._bank[Register.STREAM_PORT] & 0xFFFF
        if firing.acquisition == self._acquisition and port and not self.faults.frozen:
            delay_s = self._bank[Register.STREAM_PACKET_DELAY] / TICK_FREQUENCY_HZ
            self._stream.send(delivery.block, (socket.inet_ntoa(address), port), delay_s)


def _stacked(images: Sequence[Image]) -> Image:
    """One image above the other."""
    both: NDArray[Any] = np.concatenate(images)
    return both
