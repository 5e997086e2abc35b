"""BodyLimit: no request brings more than the server could want, or takes longer than that. A pure ASGI layer.

Nothing of what is too much is kept.
"""

import asyncio

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.web.problems import problem

MOST_BYTES = 1_000_000
"""The longest plan, with notes and a thousand positions, has a tenth of that."""
BODY_S = 30.0
"""In which it must have come; a megabyte takes 10 s by the slowest telephone line."""
_TOO_SLOW = "the body of this request did not come: send it at once"
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
    """Count what comes without saying how much it will be, and wait for it no longer than it takes."""
    got_bytes, end_s = 0, asyncio.get_running_loop().time() + BODY_S
    is_whole = False

    async def receive_counted() -> Message:
        nonlocal got_bytes, is_whole
        try:
            async with asyncio.timeout_at(None if is_whole else end_s):  # whole, it is only waited for who leaves
                message = await receive()
        except TimeoutError as error:
            raise HTTPException(408, _TOO_SLOW, {"Connection": "close"}) from error
        is_whole = not message.get("more_body")
        got_bytes += len(message.get("body", b""))
        if got_bytes > MOST_BYTES:
            raise HTTPException(413, _TOO_LARGE)
        return message

    return receive_counted
