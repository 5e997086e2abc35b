"""One question to a GigE Vision camera that ends in time, from any thread, and without control of the camera.

Aravis 0.8 asks a silent camera five times, half a second each; no call shortens that, and its objects belong to one
thread each. A register may be read by anybody, so this asks by a socket of its own.
"""

import socket
import struct
from time import monotonic

from daq.errors import DeviceUnavailable

ASK_LIMIT_S = 1.0
"""For an answer; the question is repeated meanwhile, as datagrams go astray."""

_REPEAT_S = 0.25
_PORT = 3956
_KEY, _ACKNOWLEDGE = 0x42, 0x01
_READ_REGISTER = 0x0080
_CONTROL_PRIVILEGE = 0x0A00
_QUESTION = struct.Struct(">BBHHHI")
_ANSWER = struct.Struct(">HHHHI")


def is_controlled(name: str, ip: str, limit_s: float = ASK_LIMIT_S) -> bool:
    """Whether any client has control of the camera, as it answers itself.

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
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.connect((ip, _PORT))
            deadline_s = monotonic() + limit_s
            number = 0
            while (left_s := deadline_s - monotonic()) > 0:
                number += 1
                sock.settimeout(min(_REPEAT_S, left_s))
                sock.send(_QUESTION.pack(_KEY, _ACKNOWLEDGE, _READ_REGISTER, 4, number, _CONTROL_PRIVILEGE))
                privilege = _answer(sock, number)
                if privilege is not None:
                    return privilege != 0
    except OSError as error:
        raise DeviceUnavailable(name, f"no camera answers at {ip} ({error.strerror})") from error
    raise DeviceUnavailable(name, f"no camera answers at {ip} within {limit_s:g} s")


def _answer(sock: socket.socket, number: int) -> int | None:
    """Value of the register; None if no answer to this question came in time."""
    try:
        answer = sock.recv(64)
    except TimeoutError:
        return None
    if len(answer) != _ANSWER.size:
        return None
    status, command, _, answered, privilege = _ANSWER.unpack(answer)
    return int(privilege) if (status, command, answered) == (0, _READ_REGISTER + 1, number) else None
