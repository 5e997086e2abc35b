"""The client of the server: everything it can ask, answers that get lost, and a server that is not there."""

import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.cutting_relay import CuttingRelay
from tests.support.fresh_interpreter import modules_after, packages_of
from tests.support.memory_rig import MemoryRig
from tests.support.server_process import eventually, free_port
from tests.support.serving import DEADLINE_S, Serving, plan_of, serving
from tomoshadow.client import ClientError, RigClient

LONG = plan_of(shots=1000, rate_hz=5.0)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    with serving(tmp_path_factory.mktemp("data")) as running:
        yield running


@pytest.fixture(autouse=True)
def at_rest(server: Serving) -> Iterator[None]:
    yield
    server.services.acquisition.abort()
    server.wait()


@pytest.fixture
def client(server: Serving) -> RigClient:
    return RigClient(f"http://127.0.0.1:{server.port}")


def generator(server: Serving) -> Any:
    assert isinstance(server.services.laboratory, MemoryRig)
    return server.services.laboratory.generator


def relay(server: Serving, request: bytes, times: int = 1) -> CuttingRelay:
    return CuttingRelay(server.port, lambda seen: seen.startswith(request), times)


def test_it_needs_nothing_but_python() -> None:
    loaded = packages_of(modules_after("import tomoshadow.client"))
    assert "tomoshadow" in loaded
    assert not loaded & {"server", "processing", "daq", "numpy", "pydantic", "httpx"}


def test_a_run_is_started_followed_and_told(client: RigClient) -> None:
    assert client.readiness().ready
    assert client.readiness(plan_of()).reasons == ()
    run_id = client.start(plan_of(shots=3))
    events = list(client.follow(run_id, DEADLINE_S))
    assert {event.data["run_id"] for event in events} <= {run_id}
    run = client.run(run_id)
    assert (run.outcome, run.shots_planned, run.shots_valid) == ("completed", 3, 3)
    assert client.rig().acquisition.active_run is None
    assert next(client.runs(limit=1)) == run


def test_a_run_that_has_ended_is_followed_at_once(client: RigClient) -> None:
    run_id = client.start(plan_of(shots=1))
    list(client.follow(run_id, DEADLINE_S))
    assert list(client.follow(run_id, DEADLINE_S)) == []


def test_runs_come_page_by_page(client: RigClient, monkeypatch: pytest.MonkeyPatch) -> None:
    for _ in range(3):
        list(client.follow(client.start(plan_of(shots=1)), DEADLINE_S))
    every = [run.run_id for run in client.runs()]
    monkeypatch.setattr("tomoshadow.client.rig_client._PAGE", 2)
    assert [run.run_id for run in client.runs()] == every
    assert [run.run_id for run in client.runs(limit=3)] == every[:3]
    assert [run.run_id for run in client.runs(limit=2, offset=1)] == every[1:3]


def test_stop_ends_a_run_after_its_shot(client: RigClient) -> None:
    run_id = client.start(LONG)
    client.stop(run_id)
    list(client.follow(run_id, DEADLINE_S))
    assert client.run(run_id).outcome == "stopped"


def test_a_refusal_has_code_remedy_and_status(client: RigClient) -> None:
    client.start(LONG)
    with pytest.raises(ClientError, match="wait for its end") as refused:
        client.start(plan_of())
    assert (refused.value.code, refused.value.status) == ("busy", 409)
    assert not refused.value.is_bad_input
    with pytest.raises(ClientError, match="shots") as wrong:
        client.start(plan_of(shots=0))
    assert wrong.value.status == 422
    assert wrong.value.is_bad_input


def test_a_run_whose_answer_was_lost_starts_once(server: Serving) -> None:
    before = len(list(RigClient(f"http://127.0.0.1:{server.port}").runs()))
    with relay(server, b"POST /api/runs", times=2).open() as between:
        client = RigClient(between.url)
        run_id = client.start(plan_of(shots=2))
        assert len(between.seen) == 3
        list(client.follow(run_id, DEADLINE_S))
        assert next(client.runs()).run_id == run_id
        assert len(list(client.runs())) == before + 1


def test_a_request_that_comes_late_starts_nothing(
    server: Serving, client: RigClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As one does that a network held up, or that a server gets which was started anew meanwhile."""
    fired, now_s = generator(server).fired, server.app.state.context.beat._now_s
    asked = RigClient.rig

    def ask_long_ago(self: RigClient) -> Any:
        rig = asked(self)
        monkeypatch.setattr(server.app.state.context.beat, "_now_s", lambda: now_s() + 3)
        return rig

    monkeypatch.setattr(RigClient, "rig", ask_long_ago)
    with pytest.raises(ClientError, match="nothing was started") as refused:
        client.start(plan_of())
    assert refused.value.code == "stale_request"
    assert generator(server).fired == fired


def test_a_stream_that_breaks_is_taken_up_again(server: Serving) -> None:
    with relay(server, b"GET /api/events").open() as between:
        client = RigClient(between.url)
        run_id = client.start(plan_of(shots=4, rate_hz=4.0))
        list(client.follow(run_id, DEADLINE_S))
        assert len(between.seen) == 2
        assert client.run(run_id).outcome == "completed"


def test_following_has_a_deadline(client: RigClient) -> None:
    run_id = client.start(LONG)
    with pytest.raises(ClientError, match=r"still under way after 0\.2 s") as over:
        list(client.follow(run_id, wait_s=0.2))
    assert over.value.code == "deadline"


def test_no_server_there_is_said_with_its_remedy() -> None:
    with pytest.raises(ClientError, match=r"no server answers at http://127\.0\.0\.1:\d+ .*: start it") as absent:
        RigClient(f"http://127.0.0.1:{free_port()}").rig()
    assert absent.value.code == "unreachable"
    with pytest.raises(ClientError, match="is no address of a server"):
        RigClient("localhost:8080")


def test_an_answer_that_does_not_come_is_waited_for_until_the_deadline() -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        client = RigClient(f"http://127.0.0.1:{silent.getsockname()[1]}", timeout_s=0.2)
        with pytest.raises(ClientError) as late:
            client.rig()
    assert late.value.code == "no_answer"


@pytest.mark.parametrize("content", [b"<html>hello</html>", b'{"name": "another"}'])
def test_a_server_of_another_kind_is_told(content: bytes) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:

        def answer() -> None:
            visitor, _ = other.accept()
            with visitor:
                visitor.recv(65536)
                visitor.sendall(b"HTTP/1.0 200 OK\r\n\r\n" + content)

        answering = threading.Thread(target=answer)
        answering.start()
        with pytest.raises(ClientError) as told:
            RigClient(f"http://127.0.0.1:{other.getsockname()[1]}").rig()
        answering.join(DEADLINE_S)
    assert told.value.code == "senseless"


def test_abort_is_confirmed(server: Serving, client: RigClient) -> None:
    run_id = client.start(LONG)
    assert run_id in client.abort(limit_s=DEADLINE_S)
    server.wait()
    assert client.run(run_id).outcome == "aborted"
    assert client.abort(limit_s=DEADLINE_S)


def test_abort_passes_a_server_that_is_busy(server: Serving, client: RigClient) -> None:
    run_id = client.start(LONG)
    loop, blocked, go_on = server.services.events._loop, threading.Event(), threading.Event()
    assert loop is not None

    def block() -> None:
        blocked.set()
        go_on.wait(DEADLINE_S)

    loop.call_soon_threadsafe(block)
    assert blocked.wait(DEADLINE_S)
    try:
        assert client.abort(limit_s=DEADLINE_S) == f"run {run_id}"
    finally:
        go_on.set()


def test_abort_that_nobody_confirms_sends_to_the_hardware_stop() -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        began_s = time.monotonic()
        with pytest.raises(ClientError, match=r"NOT DELIVERED \(no answer within .*\): use the hardware stop") as lost:
            RigClient(f"http://127.0.0.1:{port}", abort_port=port).abort()
    assert time.monotonic() - began_s >= 1
    assert lost.value.code == "not_delivered"


def test_alarms_are_acknowledged_one_by_one(server: Serving, client: RigClient) -> None:
    generator(server).trip("overcurrent")
    eventually(lambda: bool(client.alarms()), "the fault is told")
    (alarm,) = client.alarms()
    assert alarm.latched
    assert alarm.remedy
    client.acknowledge(alarm)
    eventually(lambda: client.alarms() == (), "the fault is cleared")
    with pytest.raises(ClientError, match="there is no alarm"):
        client.acknowledge(alarm)


def test_the_token_comes_from_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with serving(tmp_path, token="secret-word-of-the-rig") as guarded:
        url = f"http://127.0.0.1:{guarded.port}"
        with pytest.raises(ClientError, match="TOMOSHADOW_TOKEN"):
            RigClient(url).rig()
        monkeypatch.setenv("TOMOSHADOW_TOKEN", "secret-word-of-the-rig")
        assert RigClient(url).rig().name
        assert RigClient(url, token="secret-word-of-the-rig").rig().name
