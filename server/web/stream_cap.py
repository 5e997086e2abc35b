"""StreamCap: nobody asks for more at once than many pages need. A pure ASGI layer.

Each open stream of events, beats or pictures costs the server work, and so does a mesh while it is made; a script that
forgets to close them, or asks for a hundred, would take it from everybody else.
"""

import re
from collections import Counter
from dataclasses import dataclass

from starlette.requests import HTTPConnection
from starlette.responses import Response
from starlette.types import ASGIApp, Receive, Scope, Send

from server.web.guard import address_of
from server.web.problems import problem
from server.web.tries import home_of

MOST_STREAMS = 64
"""Of one address; a page has two."""
MOST_MESHES = 8
"""Of one address; a page asks for two."""


@dataclass(frozen=True)
class Cap:
    """What an address may have at once: so many of these paths."""

    what: str
    paths: re.Pattern[str]
    most: int


CAPS = (
    Cap("open streams", re.compile("/api/(events|beat|live)"), MOST_STREAMS),
    Cap("meshes under way", re.compile(r"/api/runs/.*/surface\.glb"), MOST_MESHES),
)


class StreamCap:
    """Answers 429 to an address that has as many as it may have.

    Parameters
    ----------
    app : ASGIApp
        What gets all other requests.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._open = Counter[tuple[str, str]]()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it; event loop only."""
        cap = _cap_of(scope)
        if cap is None:
            await self._app(scope, receive, send)
            return
        address = home_of(address_of(scope))
        if self._open[address, cap.what] >= cap.most:
            await _refusal(scope, address, cap)(scope, receive, send)
            return
        self._open[address, cap.what] += 1
        try:
            await self._app(scope, receive, send)
        finally:
            self._open[address, cap.what] -= 1
            self._open += Counter()  # forgets who has none


def _cap_of(scope: Scope) -> Cap | None:
    if scope["type"] not in ("http", "websocket"):
        return None
    return next((cap for cap in CAPS if cap.paths.fullmatch(scope["path"])), None)


def _refusal(scope: Scope, address: str, cap: Cap) -> Response:
    detail = f"{address} has {cap.most} {cap.what}, and may have no more: wait for one, or close it"
    answer = problem(HTTPConnection(scope), 429, detail)
    answer.headers["Retry-After"] = "1"
    return answer
