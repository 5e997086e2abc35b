"""What makes light carries a key and the last beat: obeyed once, and now or never."""

from typing import Any

import httpx
import pytest
from websockets.sync.client import connect

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
