"""Connection: requests to one server, each on a socket of its own and with a deadline; errors are ClientError."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from http.client import HTTPConnection, HTTPException, HTTPResponse, HTTPSConnection
from types import MappingProxyType
from typing import Any
from urllib.parse import urlsplit

from tomoshadow.client.errors import ClientError

Headers = Mapping[str, str]
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
        with self._answer(method, path, body, headers or {}, self.timeout_s) as answer, self._told_errors():
            content = answer.read()
        if answer.status >= 400:
            raise _refusal(answer.status, content)
        try:
            return json.loads(content), dict(answer.headers)
        except ValueError as error:
            raise self._senseless(content) from error

    def lines(self, path: str, headers: Headers, silence_s: float) -> Iterator[str]:
        """Lines of an answer that goes on and on; ClientError when it says nothing for too long, or breaks off."""
        with self._answer("GET", path, None, headers, silence_s) as answer:
            if answer.status >= 400:
                raise _refusal(answer.status, answer.read())
            while True:
                with self._told_errors():
                    line = answer.readline()
                if not line:
                    return
                yield line.decode("utf-8", "replace").rstrip("\r\n")

    @contextmanager
    def _answer(self, method: str, path: str, body: Any, headers: Headers, timeout_s: float) -> Iterator[HTTPResponse]:
        connection = self._kind(self.host, self._port, timeout=timeout_s)
        kind = {} if body is None else {"Content-Type": "application/json"}
        try:
            with self._told_errors(unreachable=True):
                connection.connect()
            with self._told_errors():
                content = None if body is None else json.dumps(body)
                connection.request(method, path, content, {**self._headers, **kind, **headers})
                answer = connection.getresponse()
            with answer:
                yield answer
        finally:
            connection.close()

    @contextmanager
    def _told_errors(self, unreachable: bool = False) -> Iterator[None]:
        try:
            yield
        except (OSError, HTTPException) as error:
            why = getattr(error, "strerror", None) or str(error) or type(error).__name__
            if unreachable:
                remedy = "start it with tomoshadow serve, or name another one"
                raise ClientError(f"no server answers at {self.url} ({why})", "unreachable", remedy) from error
            raise ClientError(f"{self.url} broke off or did not answer in time ({why})", "no_answer") from error

    def _senseless(self, content: bytes) -> ClientError:
        return ClientError(f"{self.url} is no tomoshadow server: it answers {content[:40]!r}", "senseless")


def _refusal(status: int, content: bytes) -> ClientError:
    try:
        told = json.loads(content)
        text = told.get("detail") or told.get("title") or ""
    except (ValueError, AttributeError):
        told, text = {}, ""
    remedy = told.get("remedy") or ("set TOMOSHADOW_TOKEN to the token of the server" if status == 401 else "")
    return ClientError(text or f"the server answered with status {status}", told.get("code") or "", remedy, status)
