"""AbortListener: a second door to the light switch, with a thread, an event loop and a port of its own.

Whatever the server is busy with, this answers. It knows neither token nor lock: whoever reaches the port may end the
light, and nothing else. Other sites' pages are refused, as ``server.web.guard`` refuses them.
"""

import asyncio
import socket
import threading
from collections.abc import Callable, Collection
from types import TracebackType
from typing import Self

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route
from uvicorn.protocols.http.h11_impl import H11Protocol

from daq.errors import DaqError
from server.web.connections import welcome
from server.web.ending_server import EndingServer
from server.web.guard import is_ours, site_of
from server.web.problems import MEDIA_TYPE

PATH = "/abort"
REQUEST_S = 5.0
"""In which a whole request must have come; a connection is for one."""
_END_S = 3.0
_MOST_ORIGINS = 64


class AbortListener:
    """Listens while its ``with`` block lasts.

    Parameters
    ----------
    abort : Callable[[], str]
        Switches the light off, from any thread; what was ended, in words. DaqError if the light is not confirmed off.
    held : socket.socket
        Listens already.
    host_names : Collection[str] | None
        Names of this server beside the loopback ones; None where the server has a token, and so any name.
    """

    def __init__(
        self, abort: Callable[[], str], held: socket.socket, host_names: Collection[str] | None = None
    ) -> None:
        self._abort = abort
        self._held = held
        self._host_names = host_names
        self._origins: dict[str, None] = {}
        app = Starlette(routes=[Route(PATH, self._answer, methods=["POST"])])
        config = uvicorn.Config(
            app,
            http=_OneRequest,
            ws="none",
            headers=[("Connection", "close")],
            lifespan="off",
            log_config=None,
            access_log=False,
            timeout_graceful_shutdown=1,
        )
        self._server = EndingServer(config)
        self._thread = threading.Thread(
            target=self._server.run, kwargs={"sockets": [held]}, name="abort listener", daemon=True
        )

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end()
        self._thread.join(_END_S)

    def end(self) -> None:
        """Let it end; the end of the block waits for that."""
        self._server.end()

    @property
    def port(self) -> int:
        """Where it listens."""
        return int(self._held.getsockname()[1])

    def admit(self, page: str) -> None:
        """A page of this server has this host and port: it may ask from now on. Of many the first one is forgotten."""
        self._origins.pop(page.lower(), None)
        self._origins[page.lower()] = None
        for oldest in list(self._origins)[:-_MOST_ORIGINS]:
            self._origins.pop(oldest, None)

    async def _answer(self, request: Request) -> Response:
        host, origin = request.headers.get("host", ""), request.headers.get("origin")
        if self._host_names is not None and not is_ours(host, self._host_names):
            return _problem(403, f"host {host!r} is not a name of this server")
        if origin is not None and site_of(origin) not in self._origins:
            return _problem(403, f"origin {origin!r} is no page of this server")
        answer = await run_in_threadpool(self._switch_off)
        if origin is not None:
            answer.headers["Access-Control-Allow-Origin"] = origin
        return answer

    def _switch_off(self) -> Response:
        try:
            return JSONResponse({"light": "off", "ended": self._abort()})
        except DaqError as error:
            return _problem(503, f"the light is not confirmed off: {error}")


class _OneRequest(H11Protocol):
    """A connection that is closed where no request comes in time."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as uvicorn has it
        super().connection_made(transport)
        welcome(self, REQUEST_S)


def _problem(status: int, detail: str) -> Response:
    return JSONResponse({"type": "about:blank", "status": status, "detail": detail}, status, media_type=MEDIA_TYPE)
