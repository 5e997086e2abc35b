"""Commands that ask whatever listens at an address: one sentence and an exit code within a deadline, never a traceback.

And never that the light is off because somebody answered 200.
"""

import json
import re
import socket
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from server.cli.clients import server_option
from server.cli.main import main
from tomoshadow.client import ClientError, RigClient
from tomoshadow.client.connection import Connection
from tomoshadow.client.event_stream import events_of

Answer = Callable[[socket.socket, bytes], None]
PATIENCE_S = 0.5
RIG = {
    "name": "rig",
    "simulated": True,
    "views": [],
    "beat": 1,
    "abort_port": 0,
    "acquisition": {
        "state": "acquiring",
        "outcome": None,
        "run_id": "r1",
        "shots_planned": 1,
        "shots_recorded": 0,
        "shots_valid": 0,
        "message": "",
    },
}


def whole(status: str, kind: str, body: bytes) -> bytes:
    head = f"HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {len(body)}\r\nConnection: close\r\n\r\n"
    return head.encode() + body


def says(content: bytes) -> Answer:
    return lambda one, _: one.sendall(content)


def rig_but(**changes: Any) -> Answer:
    return says(whole("200 OK", "application/json", json.dumps({**RIG, **changes}).encode()))


def hangs(one: socket.socket, _: bytes) -> None:
    one.settimeout(60)
    one.recv(1)


def drips(one: socket.socket, _: bytes) -> None:
    """A header that is never whole, a byte at a time: no single wait is long."""
    one.sendall(b"HTTP/1.1 200 OK\r\nX: ")
    while True:
        one.sendall(b"x")
        threading.Event().wait(0.05)


def never_ends(one: socket.socket, _: bytes) -> None:
    one.sendall(b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nConnection: close\r\n\r\n")
    while True:
        one.sendall(b" " * 65536)


JSON = "application/json"
OTHERS: dict[str, Answer] = {
    "garbage": says(b"\x00\xff\x16\x03 not http\r\n\r\n"),
    "closes": lambda one, _: None,
    "hangs": hangs,
    "drips": drips,
    "never ends": never_ends,
    "500 in HTML": says(whole("500 Internal Server Error", "text/html", b"<html><h1>Oops</h1></html>")),
    "500 in odd JSON": says(
        whole("500 Internal Server Error", JSON, b'{"detail": {"a": [1]}, "remedy": 3, "code": []}')
    ),
    "HTML": says(whole("200 OK", "text/html", b"<html>It works!</html>")),
    "nothing": says(whole("204 No Content", JSON, b"")),
    "redirect": says(b"HTTP/1.1 302 Found\r\nLocation: http://127.0.0.1:1/\r\nContent-Length: 0\r\n\r\n"),
    "cut": says(b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: 999\r\n\r\n{"),
    "deep": says(whole("200 OK", JSON, b"[" * 200_000)),
    **{repr(body): says(whole("200 OK", JSON, body)) for body in (b"{}", b"[]", b"null", b"7", b'"text"')},
    "a run that is a number": rig_but(acquisition={**RIG["acquisition"], "run_id": 7}),  # type: ignore[dict-item]
    "a port that is none": rig_but(abort_port="x"),
    "an acquisition that is a list": rig_but(acquisition=[]),
}


@contextmanager
def listening(answer: Answer) -> Iterator[str]:
    """A server that answers whatever is asked in one way."""
    with socket.create_server(("127.0.0.1", 0)) as door:

        def attend(one: socket.socket) -> None:
            with one, suppress(OSError):
                answer(one, one.recv(65536))

        def work() -> None:
            with suppress(OSError):
                while True:
                    threading.Thread(target=attend, args=(door.accept()[0],), daemon=True).start()

        threading.Thread(target=work, daemon=True).start()
        yield f"http://127.0.0.1:{door.getsockname()[1]}"
        door.shutdown(socket.SHUT_RDWR)


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """As the commands, with less patience."""

    def client_of(options: Any) -> RigClient:
        return RigClient(options.server, timeout_s=PATIENCE_S)

    for command in ("run", "stop", "watch", "abort"):
        monkeypatch.setattr(f"server.cli.clients.{command}.client_of", client_of)
    assert callable(server_option.client_of)


@pytest.mark.parametrize("command", ["run", "stop", "watch", "abort"])
@pytest.mark.parametrize("other", OTHERS)
@pytest.mark.usefixtures("impatient")
@pytest.mark.timeout(60)
def test_it_is_one_sentence_and_an_exit_code(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str, other: str
) -> None:
    (plan := tmp_path / "plan.toml").write_text(
        'name = "x"\nshots = 1\nrate_hz = 1\n[pulse]\ncurrent_a = { view1 = 5 }\n'
    )
    named = [plan] if command == "run" else []
    with listening(OTHERS[other]) as url:
        assert main([command, *map(str, named), "--server", url]) == 1
        said = capsys.readouterr()
        assert "confirmed" not in said.out
        assert said.err.startswith("tomoshadow: ")
        assert len(said.err.splitlines()) == 1
        assert re.search(f"{url}|hardware stop", said.err)
        assert "Traceback" not in said.err


@pytest.mark.parametrize("body", [b"{}", b"[]", b"null", b'"off"', b'{"light": "on", "ended": "x"}', b'{"ended": "x"}'])
def test_only_a_server_that_says_so_has_switched_the_light_off(body: bytes) -> None:
    with listening(says(whole("200 OK", JSON, body))) as url, pytest.raises(ClientError, match="NOT DELIVERED"):
        RigClient(url).abort()


@pytest.mark.parametrize("line", ["data: {", "data: 7", "data: []", 'data: {"id": 1}', 'data: {"id": "a", "name": 3}'])
def test_an_event_that_is_none_is_told(line: str) -> None:
    with pytest.raises(ClientError, match="http://rig:8080 says something else than this client expects"):
        list(events_of([line, ""], "http://rig:8080"))


@pytest.mark.parametrize("shot", [{}, {"index": "1", "valid": True}, {"index": 0}])
@pytest.mark.usefixtures("impatient")
def test_a_shot_that_is_none_is_told(capsys: pytest.CaptureFixture[str], shot: Mapping[str, object]) -> None:
    event = {"id": 1, "name": "shot_recorded", "time_utc": "", "data": {"run_id": "r1", **shot}}
    counts = {"shots_planned": 2, "shots_recorded": 1, "shots_valid": None}
    run = {"run_id": "r1", "name": "", "kind": "sample", "created_utc": "", "outcome": "active", "cause": "", **counts}

    def answer(one: socket.socket, request: bytes) -> None:
        events = whole("200 OK", "text/event-stream", b"data: " + json.dumps(event).encode() + b"\n\n")
        one.sendall(events if b"/api/events" in request else whole("200 OK", JSON, json.dumps(run).encode()))

    with listening(answer) as url:
        assert main(["watch", "r1", "--server", url]) == 1
        assert f"{url} says something else than this client expects" in capsys.readouterr().err


def test_a_line_without_an_end_is_not_kept() -> None:
    with listening(never_ends) as url, pytest.raises(ClientError, match="a line without an end"):
        for _ in Connection(url, None, 5).lines("/api/events", {}, 5):
            pass


def test_a_start_without_a_place_of_its_run_is_told() -> None:
    created = whole("201 Created", JSON, json.dumps(RIG).encode())
    with listening(says(created)) as url, pytest.raises(ClientError, match=f"{url} does not say which run was started"):
        RigClient(url, timeout_s=5).start({})


def test_the_place_of_a_run_is_read_however_its_header_is_written() -> None:
    head, _, body = whole("201 Created", JSON, json.dumps(RIG).encode()).partition(b"\r\n\r\n")
    with listening(says(head + b"\r\nLocation: /api/runs/r1\r\n\r\n" + body)) as url:
        assert RigClient(url, timeout_s=5).start({}) == "r1"
