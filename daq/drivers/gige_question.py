"""One question to a GigE Vision camera that ends in time, from any thread, and without control of the camera.

Aravis 0.8 asks a silent camera five times, half a second each; no call shortens that, and its objects belong to one
thread each. A register may be read by anybody, so this asks by a socket of its own.
"""

import socket
import struct
from dataclasses import dataclass
from itertools import count
from time import monotonic

from daq.errors import DeviceUnavailable

ASK_LIMIT_S = 1.0
"""For an answer; the question is repeated meanwhile, as datagrams go astray."""

_REPEAT_S = 0.25
_PORT = 3956
_KEY, _ACKNOWLEDGE = 0x42, 0x01
_READ_REGISTER = 0x0080
_PRIVILEGE, _PRIMARY_PORT, _PRIMARY_IP = 0x0A00, 0x0A04, 0x0A14
_HEADER = struct.Struct(">BBHHH")


@dataclass(frozen=True)
class Controller:
    """Who controls a camera, as the camera says it.

    Parameters
    ----------
    ip : str
        Address; ``0.0.0.0`` where the camera does not tell.
    port : int
        Its UDP port; 0 where the camera does not tell.
    """

    ip: str = "0.0.0.0"  # noqa: S104  nobody listens there
    port: int = 0

    def __str__(self) -> str:
        return f"{self.ip}:{self.port}" if self.port else "another client"


def controller_of(name: str, ip: str, limit_s: float = ASK_LIMIT_S) -> Controller | None:
    """Who controls the camera, as it answers itself; None if nobody does.

    Parameters
    ----------
    name : str
        Name in the rig configuration; errors carry it.
    ip : str
        Address of the camera.
    limit_s : float
        Deadline.

    Raises
    ------
    DeviceUnavailable
        Nothing answers there.
    """
    deadline_s = monotonic() + limit_s
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.connect((ip, _PORT))
            sock.settimeout(_REPEAT_S)
            numbers = count(1)
            while monotonic() < deadline_s:
                # Not every camera tells more than its privilege, or answers a question for several registers.
                for registers in ((_PRIVILEGE, _PRIMARY_PORT, _PRIMARY_IP), (_PRIVILEGE,)):
                    if told := _read(sock, next(numbers), *registers):
                        privilege, *client = told
                        return _client(client) if privilege else None
    except OSError as error:
        raise DeviceUnavailable(name, f"no camera answers at {ip} ({error.strerror})") from error
    raise DeviceUnavailable(name, f"no camera answers at {ip} within {limit_s:g} s")


def _read(sock: socket.socket, number: int, *registers: int) -> tuple[int, ...]:
    """Values of registers; none if the camera refuses, or no answer to this question comes in time."""
    body = struct.Struct(f">{len(registers)}I")
    sock.send(_HEADER.pack(_KEY, _ACKNOWLEDGE, _READ_REGISTER, body.size, number) + body.pack(*registers))
    try:
        while True:
            answer = sock.recv(64)
            if answer[2:4] + answer[6:8] == struct.pack(">HH", _READ_REGISTER + 1, number):
                return body.unpack_from(answer, 8) if len(answer) == 8 + body.size and answer[:2] == b"\0\0" else ()
    except TimeoutError:
        return ()


def _client(told: list[int]) -> Controller:
    if not told:
        return Controller()
    port, address = told
    return Controller(socket.inet_ntoa(address.to_bytes(4)), port & 0xFFFF)
