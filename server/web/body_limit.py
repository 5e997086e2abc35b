"""BodyLimit: no request brings more than the server could want. A pure ASGI layer.

Nothing of what is too much is kept.
"""

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.web.problems import problem

MOST_BYTES = 1_000_000
"""The longest plan, with notes and a thousand positions, has a tenth of that."""
_TOO_LARGE = f"the body of this request is larger than {MOST_BYTES} bytes: send less"


class BodyLimit:
    """Answers 413 to a body that is too large, by what it says of itself, or as soon as it is.

    Parameters
    ----------
    app : ASGIApp
        What gets all other requests.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
        elif _stated_bytes(scope) > MOST_BYTES:
            await problem(Request(scope), 413, _TOO_LARGE)(scope, receive, send)
        else:
            await self._app(scope, _counted(receive), send)


def _stated_bytes(scope: Scope) -> int:
    stated = Headers(scope=scope).get("content-length", "")
    return int(stated) if stated.isdecimal() else 0


def _counted(receive: Receive) -> Receive:
    """Count what comes without saying how much it will be."""
    got_bytes = 0

    async def receive_counted() -> Message:
        nonlocal got_bytes
        message = await receive()
        got_bytes += len(message.get("body", b""))
        if got_bytes > MOST_BYTES:
            raise HTTPException(413, _TOO_LARGE)
        return message

    return receive_counted
