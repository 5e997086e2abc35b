"""StreamCap: nobody holds more endless answers than many pages need. A pure ASGI layer.

Each open stream of events, beats or pictures costs the server work, and a script that forgets to close them would take
it from everybody else.
"""

from collections import Counter

from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Receive, Scope, Send

from server.web.problems import problem

PATHS = ("/api/events", "/api/beat", "/api/live")
MOST_STREAMS = 64
"""Of one address; a page has two."""


class StreamCap:
    """Answers 429 to an address that has as many as it may have.

    Parameters
    ----------
    app : ASGIApp
        What gets all other requests.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._open = Counter[str]()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it; event loop only."""
        if scope["type"] not in ("http", "websocket") or scope["path"] not in PATHS:
            await self._app(scope, receive, send)
            return
        address = str((scope.get("client") or ("",))[0])
        if self._open[address] >= MOST_STREAMS:
            detail = f"{address} has {MOST_STREAMS} open streams, and may have no more: close one"
            await problem(HTTPConnection(scope), 429, detail)(scope, receive, send)
            return
        self._open[address] += 1
        try:
            await self._app(scope, receive, send)
        finally:
            self._open[address] -= 1
            self._open += Counter()  # forgets who has none
