"""ABORT has a door of its own: it is open while the server is busy, and to no page but ours."""

import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from daq.devices import GeneratorState
from daq.errors import DeviceTimeout
from server.web.abort_listener import AbortListener
from tests.support.memory_rig import MemoryRig
from tests.support.server_process import eventually
from tests.support.serving import Serving, plan_of, serving

BLOCKED_S = 5.0


@pytest.fixture
def listener(server: Serving) -> AbortListener:
    return server.abort_listener


def generator(server: Serving) -> Any:
    assert isinstance(server.services.laboratory, MemoryRig)
    return server.services.laboratory.generator


def abort(listener: AbortListener, **headers: str) -> httpx.Response:
    return httpx.post(f"http://127.0.0.1:{listener.port}/abort", headers=headers, timeout=60)


def start(server: Serving) -> str:
    run = server.http.post("/api/runs", json=plan_of(shots=1000, rate_hz=5.0)).headers["location"]
    eventually(lambda: generator(server).state is GeneratorState.ARMED, "the generator is armed")
    return str(run.rsplit("/", 1)[-1])


def test_the_light_goes_off_while_the_server_answers_nothing(
    server: Serving, listener: AbortListener, record_property: Any
) -> None:
    run_id = start(server)
    blocked = threading.Event()

    def block() -> None:
        blocked.set()
        time.sleep(BLOCKED_S)

    loop = server.services.events._loop
    assert loop is not None
    loop.call_soon_threadsafe(block)
    assert blocked.wait(60)
    began_s = time.monotonic()
    answer = abort(listener)
    took_s = time.monotonic() - began_s
    record_property("abort_s", took_s)
    assert answer.json() == {"light": "off", "ended": f"run {run_id}"}
    assert generator(server).state is GeneratorState.SAFE
    assert took_s < BLOCKED_S - 1, "it waited for the server"
    assert server.wait().outcome == "aborted"


def test_it_answers_when_nothing_runs_and_everybody_is_told(server: Serving, listener: AbortListener) -> None:
    assert abort(listener).json()["ended"] == "nothing: no run was under way"
    told = [event.data["text"] for event in server.services.events.since(0) if event.name == "abort"]
    assert told == ["ABORT of nothing: no run was under way: light confirmed off"]


def test_light_that_is_not_confirmed_off_is_no_success(
    server: Serving, listener: AbortListener, monkeypatch: pytest.MonkeyPatch
) -> None:
    def silent() -> None:
        raise DeviceTimeout("generator", "off", 0.5)

    monkeypatch.setattr(generator(server), "off", silent)
    answer = abort(listener)
    monkeypatch.undo()
    assert (answer.status_code, answer.headers["content-type"]) == (503, "application/problem+json")
    assert "not confirmed off: generator: no answer" in answer.json()["detail"]


def test_pages_of_other_sites_and_foreign_names_of_this_machine_are_refused(
    server: Serving, listener: AbortListener
) -> None:
    start(server)
    for headers in (
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://[::1"},
        {"Origin": f"http://127.0.0.1:{listener.port}"},
        {"Host": "evil.example"},
    ):
        refused = abort(listener, **headers)
        assert refused.status_code == 403, headers
        assert "access-control-allow-origin" not in refused.headers
    assert generator(server).state is GeneratorState.ARMED
    listener.admit(f"127.0.0.1:{server.port}")
    ours = f"http://127.0.0.1:{server.port}"
    answer = abort(listener, Origin=ours)
    assert (answer.status_code, answer.headers["access-control-allow-origin"]) == (200, ours)
    server.wait()


def test_it_does_nothing_else(listener: AbortListener) -> None:
    address = f"http://127.0.0.1:{listener.port}"
    assert httpx.get(f"{address}/abort").status_code == 405
    assert httpx.get(f"{address}/api/rig").status_code == 404


@pytest.fixture
def guarded(tmp_path: Path) -> Iterator[Serving]:
    with serving(tmp_path / "runs", token="correct horse battery staple") as server:
        yield server


def test_neither_a_token_nor_a_name_is_asked_for_where_the_server_has_a_token(guarded: Serving) -> None:
    assert abort(guarded.abort_listener, Host="lab-pc.example").status_code == 200


def test_the_oldest_of_many_pages_is_forgotten(listener: AbortListener) -> None:
    for port in range(100):
        listener.admit(f"127.0.0.1:{port}")
    assert abort(listener, Origin="http://127.0.0.1:1").status_code == 403
    assert abort(listener, Origin="http://127.0.0.1:99").status_code == 200


@pytest.mark.parametrize("said", [b"", b"POST /abort HTTP/1.1\r\nHost: 127.0.0.1\r\n"])
def test_a_connection_without_a_whole_request_is_closed(
    listener: AbortListener, monkeypatch: pytest.MonkeyPatch, said: bytes
) -> None:
    """Thousands of them would leave no room for the one that counts."""
    monkeypatch.setattr("server.web.abort_listener.REQUEST_S", 0.2)
    with socket.create_connection(("127.0.0.1", listener.port), timeout=10) as half:
        half.sendall(said)
        assert ends(half)


def test_a_connection_ends_with_its_answer(listener: AbortListener) -> None:
    with socket.create_connection(("127.0.0.1", listener.port), timeout=2) as asking:
        asking.sendall(b"POST /abort HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 9\r\n\r\n")
        assert asking.recv(1000).startswith(b"HTTP/1.1 200")
        assert ends(asking)


def ends(connection: socket.socket) -> bool:
    """The other side closes it, whatever it says before."""
    try:
        while connection.recv(1000):
            pass
    except TimeoutError:
        return False
    return True


def test_of_many_pages_those_that_were_opened_last_may_ask(server: Serving, listener: AbortListener) -> None:
    for number in (*range(1, 65), 1, 65):
        listener.admit(f"127.0.0.1:{number}")
    assert abort(listener, Origin="http://127.0.0.1:1").status_code == 200
    assert abort(listener, Origin="http://127.0.0.1:2").status_code == 403
