"""GVCP, the control channel of GigE Vision: registers, exclusive control with heartbeat, resend requests.

Bytes in, bytes out; the socket belongs to the camera.
"""

import socket
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import IntEnum

from daq.simulation.camera.gige_registers import Register, RegisterBank

GVCP_PORT = 3956
Peer = tuple[str, int]
ANOTHER_CLIENT: Peer = ("10.99.99.99", 50000)
"""Who takes control away in a fault."""

_KEY = 0x42
_HEADER = struct.Struct(">BBHHH")
_ACKNOWLEDGE = struct.Struct(">HHHH")
_RESEND = struct.Struct(">HHII")


class Command(IntEnum):
    """Requests; the acknowledge of a request is its code + 1."""

    PACKET_RESEND = 0x40
    READ_REGISTER = 0x80
    WRITE_REGISTER = 0x82
    READ_MEMORY = 0x84
    WRITE_MEMORY = 0x86


class Status(IntEnum):
    """Status codes of an acknowledge."""

    SUCCESS = 0x0000
    NOT_IMPLEMENTED = 0x8001
    INVALID_PARAMETER = 0x8002
    INVALID_ADDRESS = 0x8003
    WRITE_PROTECT = 0x8004
    ACCESS_DENIED = 0x8006


class _Refusal(Exception):
    def __init__(self, status: Status) -> None:
        self.status = status


@dataclass(frozen=True)
class ResendRequest:
    """Packets ``first`` to ``last`` (inclusive) of a block are wanted again."""

    block_id: int
    first: int
    last: int


class ControlChannel:
    """Answers GVCP requests out of a register bank.

    Parameters
    ----------
    bank : RegisterBank
        Memory of the camera.
    on_write : Callable[[int, int], None]
        Called with address and value after a register has been written.
    on_resend : Callable[[ResendRequest], None]
        Called for each resend request.
    """

    def __init__(
        self, bank: RegisterBank, on_write: Callable[[int, int], None], on_resend: Callable[[ResendRequest], None]
    ) -> None:
        self._bank = bank
        self._on_write = on_write
        self._on_resend = on_resend
        self._holder: Peer | None = None
        self._heard_s = 0.0
        self._held_by_another = False

    def answer(self, request: bytes, peer: Peer, now_s: float) -> bytes | None:
        """Acknowledge of one request; None where none is due."""
        if len(request) < _HEADER.size or request[0] != _KEY:
            return None
        _, _, command, length, request_id = _HEADER.unpack_from(request)
        body = request[_HEADER.size : _HEADER.size + length]
        if peer == self._holder:
            self._heard_s = now_s
        if command == Command.PACKET_RESEND:
            self._resend(body)
            return None
        status, reply = Status.SUCCESS, b""
        try:
            reply = self._execute(command, body, peer, now_s)
        except _Refusal as refusal:
            status = refusal.status
        except struct.error:
            status = Status.INVALID_PARAMETER
        return _ACKNOWLEDGE.pack(status, command + 1, len(reply), request_id) + reply

    def hand_over(self, to_another: bool) -> None:
        """Let another client have the camera, or let it give the camera back: then nobody holds it."""
        if to_another == self._held_by_another:
            return
        self._held_by_another = to_another
        if to_another:
            self._hold(ANOTHER_CLIENT)
        else:
            self._release()

    def expire(self, now_s: float) -> None:
        """Free the camera if its client's heartbeat has stopped; that stops the acquisition too."""
        limit_s = self._bank[Register.HEARTBEAT_TIMEOUT_MS] / 1e3
        if not self._held_by_another and self._holder is not None and now_s - self._heard_s > limit_s:
            self._release()

    def _execute(self, command: int, body: bytes, peer: Peer, now_s: float) -> bytes:
        if command == Command.READ_REGISTER:
            return b"".join(self._read(address, 4) for (address,) in struct.iter_unpack(">I", body))
        if command == Command.READ_MEMORY:
            address, size = struct.unpack(">IxxH", body)
            return body[:4] + self._read(address, size)
        if command in (Command.WRITE_REGISTER, Command.WRITE_MEMORY):
            written = 0
            for address, value in _writes(command, body):
                self._write(address, value, peer, now_s)
                written += 1
            return struct.pack(">HH", 0, written)
        raise _Refusal(Status.NOT_IMPLEMENTED)

    def _read(self, address: int, size: int) -> bytes:
        content = self._bank.read(address, size)
        if content is None:
            raise _Refusal(Status.INVALID_ADDRESS)
        return content

    def _write(self, address: int, value: int, peer: Peer, now_s: float) -> None:
        if self._held_by_another or self._holder not in (None, peer):
            raise _Refusal(Status.ACCESS_DENIED)
        if self._holder is None and address != Register.CONTROL_PRIVILEGE:
            raise _Refusal(Status.ACCESS_DENIED)
        if not self._bank.is_writable(address):
            raise _Refusal(Status.WRITE_PROTECT)
        if not self._bank.is_legal(address, value):
            raise _Refusal(Status.INVALID_PARAMETER)
        self._bank[address] = value
        if address == Register.CONTROL_PRIVILEGE:
            self._grant(value, peer, now_s)
        self._on_write(address, value)

    def _grant(self, value: int, peer: Peer, now_s: float) -> None:
        if value:
            self._heard_s = now_s
            self._hold(peer)
        else:
            self._release()

    def _hold(self, client: Peer) -> None:
        self._holder = client
        ip, port = client
        self._bank[Register.PRIMARY_APPLICATION_IP] = int.from_bytes(socket.inet_aton(ip))
        self._bank[Register.PRIMARY_APPLICATION_PORT] = port

    def _release(self) -> None:
        self._holder = None
        self._bank[Register.PRIMARY_APPLICATION_IP] = self._bank[Register.PRIMARY_APPLICATION_PORT] = 0
        self._bank[Register.CONTROL_PRIVILEGE] = 0
        self._bank[Register.ACQUISITION] = 0
        self._on_write(Register.ACQUISITION, 0)

    def _resend(self, body: bytes) -> None:
        if len(body) < _RESEND.size:
            return
        _, block_id, first, last = _RESEND.unpack_from(body)
        self._on_resend(ResendRequest(block_id, first & 0xFF_FFFF, last & 0xFF_FFFF))


def _writes(command: int, body: bytes) -> Iterator[tuple[int, int]]:
    if command == Command.WRITE_REGISTER:
        yield from struct.iter_unpack(">II", body)
        return
    (start,) = struct.unpack_from(">I", body)
    for index, (value,) in enumerate(struct.iter_unpack(">I", body[4:])):
        yield start + 4 * index, value
