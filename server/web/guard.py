"""Guard: who may talk to the server. A pure ASGI layer, because middleware of Starlette does not see websockets.

It checks every request and every socket, pages included. The ``Origin`` header: another site's page in the operator's
browser stays outside. The token or the session, if there is a token. Without one, the ``Host`` header: a foreign name
that somebody points at this machine would make his page our own origin; with one, his page lacks the cookie. A viewer
looks and ends the light. Every answer says what a browser may do with it.
"""

import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from ipaddress import ip_address
from urllib.parse import urlencode, urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.lab.desk.control import REMEDIES
from server.lab.desk.visitor import Role, Visitor, named_script, unnamed_script
from server.web.door import Door
from server.web.problems import problem

COOKIE = "tomoshadow"
SIGN_IN_PATH = "/sign-in"
VISITOR = "visitor"
SESSIONS = "sessions"
"""Where the scope of a request says who asks, and where a page asks whether his session goes on."""
OPERATOR_HEADER = "Tomoshadow-Operator"
_POLICY = (
    # NiceGUI writes scripts and styles into the page, and compiles templates.
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self' data:; worker-src 'self' blob:; "
    "connect-src 'self' data: blob: {own}; "
    "base-uri 'self'; form-action 'self'; frame-ancestors 'none'; object-src 'none'"
)
_ELSEWHERE = ("cross-site", "same-site")
"""Where a browser says that a page comes from whose picture this would be: such requests name no ``Origin``."""
_POLICY_VIOLATION = 1008  # RFC 6455, section 7.4.1
_LOOKING = ("GET", "HEAD", "OPTIONS")
_ABORT = r"/api/rig/abort|/api/runs/[^/]+/abort"
_OF_VIEWERS = rf"/api/rig/readiness|{_ABORT}"
_UNKNOWN = "a token is needed: header 'Authorization: Bearer <token>'"
_GET_KNOWN = "set TOMOSHADOW_TOKEN to a token of the rig file, send it, or sign in with a browser"
_SESSION_AGE_S = 30 * 24 * 3600
"""A browser forgets the session then; the server does so long before, unless it is used."""


class Guard:
    """Lets pass who comes from here and knows the token, and says who that is.

    Parameters
    ----------
    app : ASGIApp
        What is guarded.
    door : Door
        Who is let in; without tokens the loopback interface is protection enough.
    host_names : Collection[str]
        Names of this server beside the loopback ones.
    abort_port : Callable[[], int | None]
        Where pages ask for ABORT.
    """

    def __init__(
        self,
        app: ASGIApp,
        door: Door,
        host_names: Collection[str] = (),
        abort_port: Callable[[], int | None] = lambda: None,
    ) -> None:
        self._app = app
        self._door = door
        self._host_names = frozenset(name.lower() for name in host_names)
        self._abort_port = abort_port

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        entry = self._entry(scope, headers)
        send = _protected(send, self._policy(headers.get("host", "")), entry.cookie)
        if entry.refusal is None:
            await self._app({**scope, VISITOR: entry.visitor, SESSIONS: self._door.sessions}, receive, send)
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": _POLICY_VIOLATION})
        else:
            await entry.refusal(scope, receive, send)

    def _entry(self, scope: Scope, headers: Headers) -> "_Entry":
        if refusal := self._foreign(scope, headers) or self._wait(scope, headers):
            return _Entry(refusal)
        visitor, cookie = self._visitor(scope, headers), ""
        if visitor is None and not self._door.keys.are_any:
            visitor, cookie = self._let_in(scope, headers)
        return _Entry(self._refusal(scope, headers, visitor), visitor, cookie)

    def _foreign(self, scope: Scope, headers: Headers) -> Response | None:
        host, origin = headers.get("host", ""), headers.get("origin")
        if not self._door.keys.are_any and not is_ours(host, self._host_names):
            return _refuse(scope, 403, f"host {host!r} is not a name of this server")
        if origin is not None and site_of(origin) != host.lower():
            return _refuse(scope, 403, f"origin {origin!r} is not this server, {host!r}")
        if headers.get("sec-fetch-site") in _ELSEWHERE and headers.get("sec-fetch-mode") != "navigate":
            return _refuse(scope, 403, "a page of another server asks for this: open it by itself")
        return None

    def _wait(self, scope: Scope, headers: Headers) -> Response | None:
        """Who has offered too many wrong tokens is not listened to for a while; a session goes on."""
        wait_s = self._door.tries.wait_s(address_of(scope)) if "authorization" in headers else 0
        if not wait_s:
            return None
        answer = _refuse(scope, 429, f"too many wrong tokens: wait {wait_s} s")
        answer.headers["Retry-After"] = str(wait_s)
        return answer

    def _visitor(self, scope: Scope, headers: Headers) -> Visitor | None:
        """Who has a session or a token."""
        if session := self._door.sessions.find(cookie_of(headers)):
            return session
        bearer = headers.get("authorization", "").removeprefix("Bearer ")
        if not bearer:
            return None
        role = self._door.keys.role_of(bearer)
        if role is None and self._door.keys.are_any:
            self._door.tries.count(address_of(scope))
        return _script(headers, scope, role) if role else None

    def _let_in(self, scope: Scope, headers: Headers) -> tuple[Visitor, str]:
        """Without a token: a browser that opens a page gets a session, a script needs none."""
        if "text/html" not in headers.get("accept", "") or scope["path"].startswith("/api"):
            return _script(headers, scope, Role.OPERATOR), ""
        visitor = self._door.sessions.begin(Role.OPERATOR, address_of(scope))
        return visitor, session_cookie(visitor.id, headers, scope["scheme"] == "https")

    def _refusal(self, scope: Scope, headers: Headers, visitor: Visitor | None) -> Response | None:
        if scope["path"] == SIGN_IN_PATH:
            return None
        if visitor is not None:
            return _not_for_viewers(scope) if visitor.role is Role.VIEWER and _is_command(scope) else None
        if "text/html" in headers.get("accept", ""):
            return RedirectResponse(f"{SIGN_IN_PATH}?{urlencode({'page': scope['path']})}", 303)
        answer = problem(HTTPConnection(scope), 401, _UNKNOWN, code="token", remedy=self._way_in(scope, headers))
        answer.headers["WWW-Authenticate"] = "Bearer"
        return answer

    def _way_in(self, scope: Scope, headers: Headers) -> str:
        """How somebody without a token gets what he asks for; the light may be ended by everybody, at its own port."""
        port = self._abort_port()
        if scope["type"] != "http" or not re.fullmatch(_ABORT, scope["path"]) or not port:
            return _GET_KNOWN
        return f"POST http://{_name_of(headers.get('host', ''))}:{port}/abort, which needs no token; or {_GET_KNOWN}"

    def _policy(self, host: str) -> str:
        """What a page may connect to: this server and the port of ABORT, and nothing else."""
        port, name = self._abort_port(), _name_of(host)
        if not re.fullmatch(r"[A-Za-z0-9.:_\[\]-]+", host):
            return _POLICY.format(own="")
        door = f" http://{name}:{port} https://{name}:{port}" if port else ""
        return _POLICY.format(own=f"ws://{host} wss://{host}{door}")


@dataclass(frozen=True)
class _Entry:
    """Why somebody stays outside, or who he is, and the session that his browser gets."""

    refusal: Response | None
    visitor: Visitor | None = None
    cookie: str = ""


def visitor_of(connection: HTTPConnection) -> Visitor:
    """Who asks, as the guard has found."""
    visitor: Visitor = connection.scope[VISITOR]
    return visitor


def address_of(scope: Scope) -> str:
    """From where a request comes."""
    return str((scope.get("client") or ("",))[0])


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


def cookie_of(headers: Headers) -> str:
    """The session that a browser names; empty where it names none."""
    try:
        morsel = SimpleCookie(headers.get("cookie", "")).get(_cookie_name(headers))
    except CookieError:
        return ""
    return morsel.value if morsel else ""


def session_cookie(session_id: str, headers: Headers, is_secure: bool) -> str:
    """The header that gives a browser its session; an empty one ends it."""
    age_s = _SESSION_AGE_S if session_id else 0
    kept = f"{_cookie_name(headers)}={session_id}; Path=/; Max-Age={age_s}; HttpOnly; SameSite=Strict"
    is_secure = is_secure or headers.get("x-forwarded-proto") == "https"  # it harms nobody but who says so
    return f"{kept}; Secure" if is_secure else kept


def _cookie_name(headers: Headers) -> str:
    """Browsers keep cookies by host, not by port: another server on this computer has another one."""
    port = headers.get("host", "").rpartition(":")[2]
    return f"{COOKIE}-{port}" if port.isdecimal() else COOKIE


def _protected(send: Send, policy: str, cookie: str) -> Send:
    """Say with every answer what a browser may do with it."""
    protection = {
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "same-origin",
        "Content-Security-Policy": policy,
    }

    async def send_protected(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            headers.update(protection)
            if cookie:
                headers.append("Set-Cookie", cookie)
        await send(message)

    return send_protected


def _script(headers: Headers, scope: Scope, role: Role) -> Visitor:
    name = headers.get(OPERATOR_HEADER, "").strip()
    return named_script(name, role) if name else unnamed_script(address_of(scope), role)


def _is_command(scope: Scope) -> bool:
    """What a viewer may not ask for; pages know the role and refuse by themselves."""
    if scope["type"] != "http" or not scope["path"].startswith("/api"):
        return False
    return scope["method"] not in _LOOKING and not re.fullmatch(_OF_VIEWERS, scope["path"])


def _name_of(host: str) -> str:
    """A host without its port."""
    name, _, port = host.rpartition(":")
    return name if name and port.isdecimal() else host


def _is_loopback(name: str) -> bool:
    try:
        return ip_address(name).is_loopback
    except ValueError:
        return False


def _not_for_viewers(scope: Scope) -> Response:
    text, remedy = "a viewer may look and end the light, and do nothing else", REMEDIES["viewer"]
    return problem(HTTPConnection(scope), 403, text, code="viewer", remedy=remedy)


def _refuse(scope: Scope, status: int, detail: str) -> Response:
    return problem(HTTPConnection(scope), status, detail)
