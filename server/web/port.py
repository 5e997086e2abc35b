"""The port of a server: held before anything heavy is loaded, so that a server that cannot be says so at once."""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager

from daq.errors import AlreadyHeld


@contextmanager
def listening(host: str, port: int, remedy: str = "choose --port") -> Iterator[socket.socket]:
    """Hold a port until the block ends; whoever asks meanwhile waits for ``serve``.

    Raises
    ------
    AlreadyHeld
        The port is taken, or the address is none of this computer.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        listener = socket.create_server((host, port), family=family)
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else str(error)
        reason = f"{host}, port {port}: cannot listen there ({why}): end the server that does, or {remedy}"
        raise AlreadyHeld(reason) from error
    with listener:
        yield listener
