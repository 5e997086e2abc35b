"""What makes light carries a key and the last beat: obeyed once, and now or never."""

import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx
import pytest
from websockets.sync.client import connect

from tests.support.server_process import eventually
from tests.support.serving import Serving, plan_of

SHOT = {"pulse": {"current_a": {"view1": 5, "view2": 5}}}
MAKES_LIGHT = {
    "run": ("POST", "/api/runs", plan_of(shots=1)),
    "single shot": ("POST", "/api/rig/shot", SHOT),
    "live": ("PUT", "/api/rig/live", {"rate_hz": 10, **SHOT}),
}


def ask(server: Serving, what: str, **headers: str) -> httpx.Response:
    method, path, body = MAKES_LIGHT[what]
    return server.http.request(method, path, json=body, headers=headers)


def fired(server: Serving) -> int:
    laboratory: Any = server.services.laboratory
    return int(laboratory.generator.fired)


def heard(server: Serving) -> int:
    with connect(f"ws://127.0.0.1:{server.port}/api/beat") as beats:
        return int(beats.recv(60))


@pytest.mark.parametrize("what", MAKES_LIGHT)
def test_what_was_too_long_on_its_way_makes_no_light(server: Serving, what: str) -> None:
    old = ask(server, what, **{"Tomoshadow-Beat": str(heard(server) - 9)})
    assert (old.status_code, old.json()["code"]) == (412, "stale_request")
    assert old.json()["remedy"] == "look at the rig, and ask again"
    assert server.services.acquisition.status().resting
    assert fired(server) == 0
    new = ask(server, what, **{"Tomoshadow-Beat": str(heard(server))})
    assert new.status_code in (200, 201), new.text
    server.http.post("/api/rig/abort")
    server.wait()


@pytest.mark.parametrize("what", ["run", "single shot"])
def test_what_is_asked_for_twice_with_one_key_is_done_once(server: Serving, what: str) -> None:
    first = ask(server, what, **{"Idempotency-Key": "one"})
    server.wait()
    again = ask(server, what, **{"Idempotency-Key": "one"})
    assert (again.status_code, again.headers["location"]) == (201, first.headers["location"])
    assert fired(server) == 1
    other = server.http.post("/api/runs", json=plan_of(shots=3), headers={"Idempotency-Key": "one"})
    assert (other.status_code, other.json()["code"]) == (422, "key_reused")
    assert ask(server, what, **{"Idempotency-Key": "two"}).headers["location"] != first.headers["location"]
    server.wait()


ENDS_LIGHT = (
    ("POST", "/api/rig/abort"),
    ("POST", "{run}/abort"),
    ("POST", "{run}/stop"),
    ("DELETE", "/api/rig/live"),
)


@pytest.mark.parametrize(("method", "path"), ENDS_LIGHT)
def test_what_ends_the_light_waits_for_no_other_request(server: Serving, method: str, path: str) -> None:
    run = server.http.post("/api/runs", json=plan_of(shots=1000)).headers["location"]
    index_lock = server.app.state.context.runs._index._lock
    with ThreadPoolExecutor(60) as others, index_lock:  # as a disk that does not answer
        for _ in range(60):
            others.submit(httpx.get, f"http://127.0.0.1:{server.port}/api/runs", timeout=60)
        eventually(lambda: _waiting() >= 40, "all threads wait for the disk")
        try:
            answer = server.http.request(method, path.format(run=run), timeout=20)
        finally:
            server.services.acquisition.abort()
    server.wait()
    assert answer.status_code == 202, answer.text


def _waiting() -> int:
    return sum(thread.name.startswith("AnyIO worker") for thread in threading.enumerate())
