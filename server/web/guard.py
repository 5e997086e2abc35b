"""Guard: who may talk to the server. A pure ASGI layer, because middleware of Starlette does not see websockets.

It checks every request and every socket, pages included. The ``Origin`` header: another site's page in the operator's
browser stays outside. The token, if there is one. Without a token, the ``Host`` header: a foreign name that somebody
points at this machine would make his page our own origin; with one, his page lacks the cookie. Every answer says what a
browser may do with it.
"""

import hmac
from collections.abc import Collection
from http.cookies import CookieError, SimpleCookie
from ipaddress import ip_address
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.web.problems import MEDIA_TYPE

COOKIE = "tomoshadow"
SIGN_IN_PATH = "/sign-in"
_PROTECTION = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    # NiceGUI writes scripts and styles into the page, and compiles templates; ABORT has a port of its own.
    "Content-Security-Policy": (
        "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
        "img-src 'self' data: blob:; font-src 'self' data:; worker-src 'self' blob:; "
        "connect-src 'self' data: blob: http: https: ws: wss:; "
        "base-uri 'self'; form-action 'self'; frame-ancestors 'none'; object-src 'none'"
    ),
}
_POLICY_VIOLATION = 1008  # RFC 6455, section 7.4.1


class Guard:
    """Lets pass who comes from here and knows the token.

    Parameters
    ----------
    app : ASGIApp
        What is guarded.
    host_names : Collection[str]
        Names of this server beside the loopback ones.
    token : str | None
        What operators have to know; None where the loopback interface is protection enough.
    """

    def __init__(self, app: ASGIApp, host_names: Collection[str] = (), token: str | None = None) -> None:
        self._app = app
        self._host_names = frozenset(name.lower() for name in host_names)
        self._token = token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(scope)
        if refusal is None:
            await self._app(scope, receive, _protected(send))
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": _POLICY_VIOLATION})
        else:
            await refusal(scope, receive, _protected(send))

    def _refusal(self, scope: Scope) -> Response | None:
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if self._token is None and not is_ours(host, self._host_names):
            return _refuse(403, f"host {host!r} is not a name of this server")
        origin = headers.get("origin")
        if origin is not None and site_of(origin) != host.lower():
            return _refuse(403, f"origin {origin!r} is not this server, {host!r}")
        if self._token is None or scope["path"] == SIGN_IN_PATH or _offers(headers, self._token):
            return None
        if "text/html" in headers.get("accept", ""):
            return RedirectResponse(SIGN_IN_PATH, 303)
        return _refuse(401, "a token is needed: header 'Authorization: Bearer <token>'")


def site_of(origin: str) -> str:
    """Host and port of an ``Origin`` header, lower case; empty where it names none."""
    try:
        return urlsplit(origin).netloc.lower()
    except ValueError:
        return ""


def is_ours(host: str, host_names: Collection[str] = ()) -> bool:
    """Whether a ``Host`` header names the loopback interface, or is one of these names, which are lower case."""
    try:
        name = urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return False
    return name == "localhost" or name in host_names or _is_loopback(name)


def _protected(send: Send) -> Send:
    """Say with every answer what a browser may do with it."""

    async def send_protected(message: Message) -> None:
        if message["type"] == "http.response.start":
            MutableHeaders(scope=message).update(_PROTECTION)
        await send(message)

    return send_protected


def _offers(headers: Headers, token: str) -> bool:
    bearer = headers.get("authorization", "").removeprefix("Bearer ")
    return is_token(bearer, token) or is_token(_cookie(headers), token)


def is_token(offered: str, token: str) -> bool:
    """Compare in constant time."""
    return hmac.compare_digest(offered.encode(), token.encode())


def _is_loopback(name: str) -> bool:
    try:
        return ip_address(name).is_loopback
    except ValueError:
        return False


def _cookie(headers: Headers) -> str:
    try:
        morsel = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    except CookieError:
        return ""
    return morsel.value if morsel else ""


def _refuse(status: int, detail: str) -> Response:
    title = "Unauthorized" if status == 401 else "Forbidden"
    document = {"type": "about:blank", "title": title, "status": status, "detail": detail}
    headers = {"WWW-Authenticate": "Bearer"} if status == 401 else None
    return JSONResponse(document, status, headers, MEDIA_TYPE)
