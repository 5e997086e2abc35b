"""Readings: HEAD for everything that can be read, and ETag for JSON, pictures and surfaces. A pure ASGI layer.

A script that asks again names the ETag it has, and gets 304 without a body where nothing has changed. HEAD is answered
as GET: the server that speaks HTTP sends no body then.
"""

import hashlib

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_ENDLESS = ("/api/events",)
"""No HEAD: nobody waits for their end."""
_TAGGED = ("application/json", "image/jpeg", "image/png", "model/gltf-binary")


class Readings:
    """Answers HEAD below /api, and gives JSON, pictures and surfaces an ETag.

    Parameters
    ----------
    app : ASGIApp
        What answers GET.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, as GET where it is HEAD."""
        if not _is_reading(scope):
            await self._app(scope, receive, send)
        else:
            known = Headers(scope=scope).get("if-none-match", "")
            await self._app({**scope, "method": "GET"}, receive, _Tagged(known, send).send)


def _is_reading(scope: Scope) -> bool:
    if scope["type"] != "http" or scope["method"] not in ("GET", "HEAD"):
        return False
    return bool(scope["path"].startswith("/api/") and scope["path"] not in _ENDLESS)


class _Tagged:
    """Holds the head of an answer back until its body is there."""

    def __init__(self, known: str, send: Send) -> None:
        self._known = [tag.strip().removeprefix("W/") for tag in known.split(",")]
        self._send = send
        self._head: Message | None = None

    async def send(self, message: Message) -> None:
        """Pass on a part of the answer; what comes in one piece gets its ETag."""
        if message["type"] == "http.response.start" and _is_tagged(message):
            self._head = message
            return
        head, self._head = self._head, None
        if head is not None and not message.get("more_body"):
            head, message = self._tagged(head, message)
        if head is not None:
            await self._send(head)
        await self._send(message)

    def _tagged(self, head: Message, message: Message) -> tuple[Message, Message]:
        tag = f'"{hashlib.sha256(message.get("body", b"")).hexdigest()[:32]}"'
        headers = MutableHeaders(scope=head)
        headers["ETag"] = tag
        headers.setdefault("Cache-Control", "no-cache")
        if tag not in self._known:
            return head, message
        del headers["Content-Length"], headers["Content-Type"]
        return {**head, "status": 304}, {**message, "body": b""}


def _is_tagged(head: Message) -> bool:
    """A name may be given again to another run: what its pictures show tells whether they are known."""
    headers = Headers(raw=head["headers"])
    return head["status"] == 200 and "etag" not in headers and headers.get("content-type") in _TAGGED
