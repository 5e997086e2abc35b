"""RigClient: what a script asks of a rig."""

import getpass
import os
import socket
import time
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from typing import Any
from urllib.parse import quote

from tomoshadow.client.abort import LIMIT_S, switch_off
from tomoshadow.client.connection import Connection
from tomoshadow.client.errors import ClientError
from tomoshadow.client.event_stream import events_of
from tomoshadow.client.values import Alarm, Event, Readiness, Rig, Run, Value, read

DEFAULT_URL = "http://127.0.0.1:8080"
TOKEN_VARIABLE = "TOMOSHADOW_TOKEN"  # noqa: S105  where it is, not what it is
OPERATOR_HEADER = "Tomoshadow-Operator"
SILENCE_S = 20.0
"""The server says something every 15 s."""
_RETRY_S = 0.5
_LOST = ("no_answer", "unreachable")
_PAGE = 100


class RigClient:
    """A rig behind a server; nothing is asked before the first call.

    Parameters
    ----------
    url : str
        Of the server: ``http://HOST:PORT``.
    token : str | None
        None: that of the environment variable TOMOSHADOW_TOKEN, or none.
    abort_port : int | None
        Of ABORT alone, where it is known; None: the server tells it at the first ``rig()``.
    timeout_s : float
        How long one answer may take.
    """

    def __init__(
        self, url: str = DEFAULT_URL, token: str | None = None, abort_port: int | None = None, timeout_s: float = 30.0
    ) -> None:
        token = os.environ.get(TOKEN_VARIABLE) if token is None else token
        self._server = Connection(url, token, timeout_s, {OPERATOR_HEADER: _user()})
        self._abort_port = abort_port

    @property
    def url(self) -> str:
        """Of the server."""
        return self._server.url

    def rig(self) -> Rig:
        """The rig at a glance."""
        rig = self._read(Rig.of, self._get("/api/rig"))
        self._abort_port = rig.abort_port
        return rig

    def readiness(self, plan: Mapping[str, Any] | None = None) -> Readiness:
        """Whether a start would be refused, and why; of a plan, or of whatever the rig might do."""
        path = "/api/rig/readiness"
        told = self._get(path) if plan is None else self._server.ask("POST", path, plan)[0]
        return self._read(Readiness.of, told)

    def start(self, plan: Mapping[str, Any], wait_s: float = 30.0) -> str:
        """Start a run; its id. An answer that is lost is asked for again, and the run starts once.

        Parameters
        ----------
        plan : Mapping
            As in ``POST /api/runs``.
        wait_s : float
            How long lost answers are asked for again. What reaches the server more than two seconds after this call,
            and is new to it, starts nothing.

        Raises
        ------
        ClientError
            The start was refused, with the reason; or nobody knows (``no_answer``): look at ``rig().acquisition``.
        """
        headers = {"Idempotency-Key": uuid.uuid4().hex, "Tomoshadow-Beat": str(self.rig().beat)}
        end_s = time.monotonic() + wait_s
        while True:
            try:
                return self._started(self._server.ask("POST", "/api/runs", plan, headers)[1])
            except ClientError as error:
                if error.code not in (*_LOST, "in_progress") or time.monotonic() > end_s:
                    raise
            time.sleep(_RETRY_S)

    def _started(self, told: Mapping[str, str]) -> str:
        place = {name.lower(): value for name, value in told.items()}.get("location")
        if not place:
            text = f"{self.url} does not say which run was started"
            raise ClientError(text, "senseless", "tomoshadow watch tells whether one is under way")
        return place.rsplit("/", 1)[-1]

    def run(self, run_id: str) -> Run:
        """One run."""
        return self._read(Run.of, self._get(f"/api/runs/{quote(run_id, safe='')}"))

    def runs(self, limit: int | None = None, offset: int = 0) -> Iterator[Run]:
        """Runs, newest first; asked for page by page."""
        left = limit
        while left is None or left > 0:
            count = _PAGE if left is None else min(left, _PAGE)
            page = self._read(list, self._get(f"/api/runs?limit={count}&offset={offset}"))
            yield from (self._read(Run.of, run) for run in page)
            if len(page) < count:
                return
            offset += count
            left = None if left is None else left - count

    def events(self, after: int | None = None, silence_s: float = SILENCE_S) -> Iterator[Event | None]:
        """Events as they happen, or after one that was seen; None where the server says only that it lives."""
        headers = {"Accept": "text/event-stream"} | ({} if after is None else {"Last-Event-ID": str(after)})
        return events_of(self._server.lines("/api/events", headers, silence_s), self.url)

    def follow(self, run_id: str, wait_s: float, absent_s: float = 15.0) -> Iterator[Event]:
        """Events of a run until it has ended, also over a connection that breaks.

        Parameters
        ----------
        run_id : str
            Of a run that may have ended already.
        wait_s : float
            How long at most.
        absent_s : float
            How long the server may be away.

        Raises
        ------
        ClientError
            The time is over (``deadline``), or the server is away.
        """
        end_s, heard_s, last = time.monotonic() + wait_s, time.monotonic(), None
        while True:
            try:
                for event in self._until_its_end(run_id, last, end_s):
                    heard_s = time.monotonic()
                    if event is not None:
                        last = event.id
                        yield event
                return
            except ClientError as error:
                if error.code not in _LOST:
                    raise
                if time.monotonic() >= end_s:
                    raise ClientError(f"run {run_id} is still under way after {wait_s:g} s", "deadline") from error
                if time.monotonic() > heard_s + absent_s:
                    remedy = "look at the rig; a server that is started again says how the run ended"
                    text = f"the server at {self.url} is gone, and run {run_id} was under way"
                    raise ClientError(text, error.code, remedy) from error
            time.sleep(_RETRY_S)

    def _until_its_end(self, run_id: str, last: int | None, end_s: float) -> Iterator[Event | None]:
        for event in self.events(last, max(0.1, min(SILENCE_S, end_s - time.monotonic()))):
            yield event if event is not None and event.data.get("run_id") == run_id else None
            if (event is None or event.name == "run_state") and not self.run(run_id).active:
                return
            if time.monotonic() >= end_s:
                break
        raise ClientError("the stream of events has ended", "no_answer")

    def take_control(self) -> None:
        """Take control from whoever holds it; a start takes it by itself where nobody does."""
        self._server.ask("PUT", "/api/rig/control")

    def give_control_back(self) -> None:
        """Let the next one have it at once, and not in ten minutes."""
        self._server.ask("DELETE", "/api/rig/control")

    def stop(self, run_id: str) -> None:
        """End a run after the shot under way."""
        self._server.ask("POST", f"/api/runs/{quote(run_id, safe='')}/stop")

    def abort(self, limit_s: float = LIMIT_S, port: int | None = None) -> str:
        """Light off at once, whatever runs; what was ended, in words.

        Parameters
        ----------
        limit_s : float
            How long it may take until that is confirmed.
        port : int | None
            Of ABORT alone; None: as it is known.

        Raises
        ------
        ClientError
            Not confirmed within a second (``not_delivered``): use the hardware stop.
        """
        began_s = time.monotonic()
        self._abort_port = port or self._abort_port
        if self._abort_port is None:
            with suppress(ClientError):
                told, _ = self._server.within(limit_s / 3).ask("GET", "/api/rig")
                self._abort_port = self._read(Rig.of, told).abort_port
        doors = [(self._server, "/api/rig/abort")]
        if self._abort_port:
            doors.insert(0, (self._server.to_port(self._abort_port), "/abort"))
        return switch_off(doors, limit_s - (time.monotonic() - began_s))

    def alarms(self) -> tuple[Alarm, ...]:
        """What is wrong, one by one."""
        return tuple(self._read(Alarm.of, alarm) for alarm in self._read(list, self._get("/api/rig/alarms")))

    def acknowledge(self, alarm: Alarm) -> None:
        """An operator has seen this one."""
        self._server.ask("POST", f"/api/rig/alarms/{alarm.id}/acknowledge")

    def _get(self, path: str) -> Any:
        return self._server.ask("GET", path)[0]

    def _read(self, value_of: Callable[[Any], Value], told: Any) -> Value:
        return read(value_of, told, self.url)


def _user() -> str:
    """Who runs this script, as others are told."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError):
        user = "somebody"
    return f"{user}@{socket.gethostname()}".encode("ascii", "replace").decode()[:100]
