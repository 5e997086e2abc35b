"""Connection: requests to one server, each on a socket of its own and with a deadline; errors are ClientError."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from http.client import HTTPConnection, HTTPException, HTTPResponse, HTTPSConnection, IncompleteRead
from socket import SHUT_RDWR, socket
from threading import Event, Timer
from types import MappingProxyType
from typing import Any
from urllib.parse import urlsplit

from tomoshadow.client.errors import ClientError

Headers = Mapping[str, str]
_MOST_BYTES, _MOST_LINE = 1 << 24, 1 << 20
"""Of an answer, and of one of its lines."""
_SCHEMES = {"http": HTTPConnection, "https": HTTPSConnection}


class Connection:
    """The way to a server.

    Parameters
    ----------
    url : str
        ``http://HOST:PORT``.
    token : str | None
        Sent as a bearer token.
    timeout_s : float
        How long an answer may keep us waiting.
    headers : Mapping of str to str
        Sent with every request.
    """

    def __init__(self, url: str, token: str | None, timeout_s: float, headers: Headers = MappingProxyType({})) -> None:
        parts = urlsplit(url)
        try:
            self._kind, self.host, self._port = _SCHEMES[parts.scheme], parts.hostname or "", parts.port
        except (KeyError, ValueError):
            self.host = ""
        if not self.host:
            raise ClientError(f"{url!r} is no address of a server", "bad_url", "write http://HOST:PORT", 400)
        self.url = url.rstrip("/")
        self._token = token
        self._more = headers
        self._headers = {**headers, **({"Authorization": f"Bearer {token}"} if token else {})}
        self.timeout_s = timeout_s

    def within(self, timeout_s: float) -> "Connection":
        """To the same server, with another patience."""
        return Connection(self.url, self._token, timeout_s, self._more)

    def to_port(self, port: int) -> "Connection":
        """To another port of the same computer, which needs no token."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return Connection(f"http://{host}:{port}", None, self.timeout_s)

    def ask(self, method: str, path: str, body: Any = None, headers: Headers | None = None) -> tuple[Any, Headers]:
        """What the server answers, and its headers."""
        with (
            self._answer(method, path, body, headers or {}, self.timeout_s) as (answer, line),
            self._told_errors(),
            _within(line, self.timeout_s),
        ):
            content = _whole(answer)
        if answer.status >= 400:
            raise self._refusal(answer.status, content)
        try:
            return json.loads(content), dict(answer.headers)
        except (ValueError, RecursionError) as error:
            raise self._senseless(f"answers {content[:40]!r}") from error

    def lines(self, path: str, headers: Headers, silence_s: float) -> Iterator[str]:
        """Lines of an answer that goes on and on; ClientError when it says nothing for too long, or breaks off."""
        with self._answer("GET", path, None, headers, silence_s) as (answer, line):
            if answer.status >= 400:
                with self._told_errors(), _within(line, silence_s):
                    content = _whole(answer)
                raise self._refusal(answer.status, content)
            while text := self._line(answer, line, silence_s):
                yield text.decode("utf-8", "replace").rstrip("\r\n")

    def _line(self, answer: HTTPResponse, line: socket, silence_s: float) -> bytes:
        with self._told_errors(), _within(line, silence_s):
            text = answer.readline(_MOST_LINE)
        if len(text) == _MOST_LINE:
            raise self._senseless("sends a line without an end")
        return text

    @contextmanager
    def _answer(
        self, method: str, path: str, body: Any, headers: Headers, timeout_s: float
    ) -> Iterator[tuple[HTTPResponse, socket]]:
        connection = self._kind(self.host, self._port, timeout=timeout_s)
        kind = {} if body is None else {"Content-Type": "application/json"}
        try:
            with self._told_errors(unreachable=True):
                connection.connect()
            line = connection.sock
            with self._told_errors(), _within(line, timeout_s):
                content = None if body is None else json.dumps(body)
                connection.request(method, path, content, {**self._headers, **kind, **headers})
                answer = connection.getresponse()
            with answer:
                yield answer, line
        finally:
            connection.close()

    @contextmanager
    def _told_errors(self, unreachable: bool = False) -> Iterator[None]:
        try:
            yield
        except (OSError, HTTPException) as error:
            said = getattr(error, "strerror", None) or str(error) or type(error).__name__
            why = "".join(sign if sign.isprintable() else "?" for sign in said)
            if unreachable:
                remedy = "start it with tomoshadow serve, or name another one"
                raise ClientError(f"no server answers at {self.url} ({why})", "unreachable", remedy) from error
            raise ClientError(f"{self.url} broke off or did not answer in time ({why})", "no_answer") from error

    def _senseless(self, what: str) -> ClientError:
        return ClientError(f"{self.url} is no tomoshadow server: it {what}", "senseless")

    def _refusal(self, status: int, content: bytes) -> ClientError:
        try:
            told = json.loads(content)
            text, code, remedy = (_text(told.get(name)) for name in ("detail", "code", "remedy"))
            text = text or _text(told.get("title"))
        except (ValueError, AttributeError, RecursionError):
            text = code = remedy = ""
        remedy = remedy or ("set TOMOSHADOW_TOKEN to the token of the server" if status == 401 else "")
        return ClientError(text or f"{self.url} answered with status {status}", code, remedy, status)


def _text(value: object) -> str:
    return value if isinstance(value, str) else ""


def _whole(answer: HTTPResponse) -> bytes:
    content = answer.read(_MOST_BYTES)
    if answer.length or len(content) == _MOST_BYTES:
        raise IncompleteRead(content[:0], answer.length)
    return content


@contextmanager
def _within(line: socket, limit_s: float) -> Iterator[None]:
    """Shut a socket when the time is over: one that sends a byte now and then is never silent for long."""
    late = Event()

    def cut() -> None:
        late.set()
        with suppress(OSError):
            line.shutdown(SHUT_RDWR)

    timer = Timer(limit_s, cut)
    timer.daemon = True
    timer.start()
    try:
        yield
    except (OSError, HTTPException):
        if not late.is_set():
            raise
    finally:
        timer.cancel()
    if late.is_set():
        raise TimeoutError("timed out")
