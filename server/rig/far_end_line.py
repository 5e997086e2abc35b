"""The line to the far ends of a simulated rig in another process: one JSON object per line, on a local socket.

A request names what to ``do``; its reply holds the ``answer``, or an ``error`` and its ``kind``. ``follow_door`` is
answered again and again: with every move of the door, and twice a second as a sign of life.
"""

import json
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedIOBase
from typing import Any

from daq.errors import DeviceRefused

ALIVE_S = 0.5
"""So often a follower of the door hears something."""
SILENT_S = 10.0
"""A follower that hears nothing for so long takes the other process for dead; the machine may be busy."""
ANSWER_LIMIT_S = 60.0
"""Some requests start or end a device; one that is asked too early waits until all of them run."""


class LineEnded(OSError):
    """The other process has hung up."""


def somebody_listens(address: str) -> bool:
    """Whether a process runs the far ends, or is just starting them."""
    try:
        with connected(address, ALIVE_S):
            return True
    except ConnectionRefusedError:
        return False


def ask(address: str, do: str, **details: Any) -> Any:
    """Ask one thing, on a connection of its own.

    Raises
    ------
    ConnectionRefusedError
        Nobody listens there: no process runs the far ends.
    OSError
        It does not answer, or ended while it was asked.
    ValueError
        What was asked names something that the rig does not have.
    DeviceRefused
        It could not be done; the text says why.
    """
    with connected(address, ANSWER_LIMIT_S) as line:
        tell(line, {"do": do, **details})
        return answer_of(line)


@contextmanager
def connected(address: str, limit_s: float) -> Iterator[BufferedIOBase]:
    """Connect to the far ends; every wait has this limit."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        connection.settimeout(limit_s)
        connection.connect(address)
        with connection.makefile("rwb") as line:
            yield line


def tell(line: BufferedIOBase, message: dict[str, Any]) -> None:
    """Send one message."""
    line.write(json.dumps(message).encode() + b"\n")
    line.flush()


def answer_of(line: BufferedIOBase) -> Any:
    """Wait for the next reply; its answer, or what it says has gone wrong."""
    text = line.readline()
    if not text.endswith(b"\n"):
        raise LineEnded("the process has ended")
    reply = json.loads(text)
    if "error" not in reply:
        return reply["answer"]
    if reply["kind"] == ValueError.__name__:
        raise ValueError(reply["error"])
    raise DeviceRefused("far ends", reply["error"])
