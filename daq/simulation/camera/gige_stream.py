"""GVSP, the stream channel of GigE Vision: blocks cut into packets, paced to the link, kept for resend."""

import random
import socket
import struct
from collections import OrderedDict
from dataclasses import dataclass
from threading import Event, Lock
from time import perf_counter

from daq.simulation.camera.gige_control import Peer, ResendRequest
from daq.simulation.camera.gige_faults import CameraFaults
from daq.simulation.camera.gige_registers import PixelFormat

Packet = tuple[bytes, memoryview]

_HEADERS_BYTES = 36  # IP 20 + UDP 8 + GVSP 8: what the packet size register counts beside the payload
_ETHERNET_BYTES = 38  # preamble, header, checksum and gap: what the link carries beside the IP packet
_LEADER, _TRAILER, _PAYLOAD = 1, 2, 3
_IMAGE_PAYLOAD = 1
_PACKETS_PER_PAUSE = 16
_BLOCKS_KEPT = 4
_LAST_BLOCK_ID = 65535
_NOTHING = memoryview(b"")


def last_block_id(before_wrap: int) -> int:
    """Where to count from, so that ids wrap after so many blocks; 0: they start at 1."""
    return -before_wrap % _LAST_BLOCK_ID


def next_block_id(block_id: int) -> int:
    """Block ids count 1 to 65535 and wrap to 1; 0 is never used."""
    return block_id % _LAST_BLOCK_ID + 1


@dataclass(frozen=True)
class Block:
    """One image on its way: leader, payload packets, trailer.

    Parameters
    ----------
    block_id : int
        1 to 65535.
    timestamp_ns : int
        Device clock at the start of the exposure.
    pixel_format : PixelFormat
        Coding of the payload.
    shape : tuple[int, int]
        (rows, columns).
    payload : memoryview
        Bytes of the image.
    packet_bytes : int
        Size of an IP packet, headers included.
    """

    block_id: int
    timestamp_ns: int
    pixel_format: PixelFormat
    shape: tuple[int, int]
    payload: memoryview
    packet_bytes: int

    @property
    def _chunk(self) -> int:
        return self.packet_bytes - _HEADERS_BYTES

    @property
    def packet_count(self) -> int:
        """Number of packets, leader and trailer included."""
        return 2 + -(-len(self.payload) // self._chunk)

    def packet(self, index: int) -> Packet:
        """Header and payload of packet ``index``; 0 is the leader, the last one the trailer."""
        if index == 0:
            return self._leader(), _NOTHING
        if index == self.packet_count - 1:
            return self._header(_TRAILER, index) + struct.pack(">II", _IMAGE_PAYLOAD, self.shape[0]), _NOTHING
        start = (index - 1) * self._chunk
        return self._header(_PAYLOAD, index), self.payload[start : start + self._chunk]

    def _leader(self) -> bytes:
        rows, columns = self.shape
        image = struct.pack(
            ">IQIIIIIHH", _IMAGE_PAYLOAD, self.timestamp_ns, self.pixel_format, columns, rows, 0, 0, 0, 0
        )
        return self._header(_LEADER, 0) + image

    def _header(self, kind: int, index: int) -> bytes:
        return struct.pack(">HHI", 0, self.block_id, kind << 24 | index)


class StreamChannel:
    """Sends blocks to the client, at the rate of the link.

    Parameters
    ----------
    sock : socket.socket
        Bound UDP socket of the stream.
    link_bits_per_s : float
        Rate of the link.
    faults : CameraFaults
        What happens to packets at present.
    stopping : Event
        Ends every wait.
    """

    def __init__(self, sock: socket.socket, link_bits_per_s: float, faults: CameraFaults, stopping: Event) -> None:
        self._sock = sock
        self._link_bits_per_s = link_bits_per_s
        self._faults = faults
        self._stopping = stopping
        self._dice = random.Random(1)  # noqa: S311  a simulated fault, and reproducible
        self._kept: OrderedDict[int, tuple[Block, Peer]] = OrderedDict()
        self._lock = Lock()

    def send(self, block: Block, client: Peer, packet_delay_s: float = 0.0) -> None:
        """Send a whole block, with a pause between packets, and keep it for resend requests."""
        with self._lock:
            self._kept[block.block_id] = (block, client)
            while len(self._kept) > _BLOCKS_KEPT:
                self._kept.popitem(last=False)
        packet_s = (block.packet_bytes + _ETHERNET_BYTES) * 8 / self._link_bits_per_s + packet_delay_s
        started_s = perf_counter()
        for sent, index in enumerate(self._order(block.packet_count)):
            self._send(block.packet(index), client)
            if sent % _PACKETS_PER_PAUSE == 0:
                self._stopping.wait(max(0.0, started_s + sent * packet_s - perf_counter()))

    def resend(self, request: ResendRequest) -> None:
        """Send the packets once more; a block that is gone stays gone."""
        with self._lock:
            kept = self._kept.get(request.block_id)
        if kept is None:
            return
        block, client = kept
        for index in range(request.first, min(request.last, block.packet_count - 1) + 1):
            self._send(block.packet(index), client)

    def forget(self) -> None:
        """Forget all blocks: a new acquisition uses their ids again."""
        with self._lock:
            self._kept.clear()

    def _order(self, packets: int) -> list[int]:
        """Indices of the packets of a block as they leave: some after the one behind them, some twice, some not."""
        last = packets - self._faults.take("trailers_lost")
        order = list(range(self._faults.take("leaders_lost"), last))
        for place in range(len(order) - 1):
            if self._happens(self._faults.packets_swapped):
                order[place : place + 2] = order[place + 1], order[place]
        return [index for index in order for _ in range(1 + self._happens(self._faults.packets_doubled))]

    def _send(self, packet: Packet, client: Peer) -> None:
        if not self._happens(self._faults.packet_loss):
            self._sock.sendmsg(packet, (), 0, client)

    def _happens(self, share: float) -> bool:
        return share > 0 and self._dice.random() < share
