"""CuttingRelay: stands between a client and a server, and loses answers."""

import contextlib
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_LIMIT_S = 60.0


class CuttingRelay:
    """Passes every request on; the answer of the first ones of a kind is read to its end, and lost.

    Parameters
    ----------
    port : int
        Of the server.
    loses : Callable[[bytes], bool]
        Whether the answer to a request that begins so gets lost.
    times : int
        So many answers are.
    """

    def __init__(self, port: int, loses: Callable[[bytes], bool], times: int = 1) -> None:
        self._server, self._loses, self._left = port, loses, times
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._servers = list[socket.socket]()
        self.seen: list[bytes] = []
        """Every request that a client was to have lost, as far as it came in one piece."""

    @property
    def url(self) -> str:
        """Where clients find it."""
        return f"http://127.0.0.1:{self._listener.getsockname()[1]}"

    @contextmanager
    def open(self) -> Iterator["CuttingRelay"]:
        """Pass on until the block ends."""
        threading.Thread(target=self._listen, daemon=True).start()
        with self._listener:
            yield self
            for each in (self._listener, *self._servers):
                with contextlib.suppress(OSError):  # it has been closed
                    each.shutdown(socket.SHUT_RDWR)

    def _listen(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        with contextlib.suppress(OSError):  # one of the two has seen enough
            self._pass_on(client)

    def _pass_on(self, client: socket.socket) -> None:
        with client, socket.create_connection(("127.0.0.1", self._server), _LIMIT_S) as server:
            client.settimeout(_LIMIT_S)
            self._servers.append(server)
            request = _whole(client)
            server.sendall(request)
            lost = self._loses(request)
            if lost:
                self.seen.append(request)
                self._left -= 1
            if lost and self._left >= 0:
                server.recv(65536)
                return
            while piece := server.recv(65536):
                client.sendall(piece)


def _whole(client: socket.socket) -> bytes:
    """A request with its body."""
    request = b""
    while b"\r\n\r\n" not in request:
        request += _more(client)
    head, _, body = request.partition(b"\r\n\r\n")
    lengths = [line for line in head.lower().splitlines() if line.startswith(b"content-length:")]
    length = int(lengths[0].split(b":")[1]) if lengths else 0
    while len(body) < length:
        body += _more(client)
    return head + b"\r\n\r\n" + body


def _more(client: socket.socket) -> bytes:
    if not (piece := client.recv(65536)):
        raise ConnectionResetError("the client has left")
    return piece
