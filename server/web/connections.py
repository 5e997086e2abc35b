"""Connections: how many there may be, how long one may ask for nothing, and what of its headers is believed.

Every open connection takes a file of the process. Were they all taken, no shot could be stored and no ABORT come in.
"""

import asyncio
from collections.abc import Iterable
from contextlib import suppress
from typing import Any

import uvicorn
from fastapi import FastAPI
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.exceptions import InvalidState

MOST = 400
"""Of one port: a process may as a rule have 1024 files open."""
REQUEST_S = 10.0
"""In which the first request of a connection must have come."""
STALLED_S = 60.0
"""In which whoever downloads must have read a little."""
_SHUTDOWN_S = 3

Connection = HttpToolsProtocol | H11Protocol


def config_of(app: FastAPI, **more: Any) -> uvicorn.Config:
    """How the application is served.

    Parameters
    ----------
    app : FastAPI
        The application.
    **more
        What else uvicorn is told.
    """
    return uvicorn.Config(
        app,
        http=_Bounded,
        ws=_Socket,
        proxy_headers=False,  # or whoever sits at this computer says that he comes from anywhere
        access_log=False,
        ws_per_message_deflate=False,  # pictures are compressed already: it would double what a live view costs
        **{"log_level": "warning", "timeout_graceful_shutdown": _SHUTDOWN_S, **more},
    )


class _Socket(WebSocketsSansIOProtocol):
    """What a page hears the server by."""

    def shutdown(self) -> None:
        """End it with the server; a page that is being closed at this very moment breaks off nothing."""
        with suppress(InvalidState):
            super().shutdown()


class _Bounded(HttpToolsProtocol):
    """A connection of the application."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as uvicorn has it
        super().connection_made(transport)
        welcome(self, REQUEST_S)

    def pause_writing(self) -> None:
        """Whoever asks for much and reads nothing keeps a file and a connection: not for ever."""
        super().pause_writing()
        self._stalled = self.loop.call_later(STALLED_S, self.transport.abort)

    def resume_writing(self) -> None:
        """Some 64 kB have been read."""
        super().resume_writing()
        self._stalled.cancel()


def welcome(connection: Any, request_s: float) -> None:
    """Close a connection that asks for nothing in time; where there are too many, the one that has waited longest."""
    connection.loop.call_later(request_s, _close_without_request, connection)
    connection.made_s = connection.loop.time()
    if len(connection.connections) > MOST:
        _close_one(connection.connections)


def _close_without_request(connection: Connection) -> None:
    if connection.cycle is None and connection.transport.get_protocol() is connection:
        connection.transport.close()


def _close_one(connections: Iterable[Any]) -> None:
    """Whoever has something to ask asks it at once: the one that just came has a request on its way."""
    waiting: list[Any] = [one for one in connections if isinstance(one, Connection) and _is_waiting(one)]
    min(waiting, key=lambda one: one.made_s).transport.close()


def _is_waiting(connection: Connection) -> bool:
    return connection.cycle is None or connection.cycle.response_complete
