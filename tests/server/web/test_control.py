"""Who holds control, by the API: what makes light or changes the rig needs it, what ends the light does not."""

from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from server.web.tries import MOST
from tests.server.web.test_api import use_a_calibration
from tests.support.serving import Serving, plan_of, serving

ANN, BOB = ({"Tomoshadow-Operator": name} for name in ("ann@lab", "bob@lab"))
PULSE = {"current_a": {"view1": 5, "view2": 5}}
NEEDS_IT = (
    ("POST", "/api/runs", plan_of(shots=1)),
    ("POST", "/api/rig/shot", {"pulse": PULSE}),
    ("PUT", "/api/rig/live", {"rate_hz": 10}),
    ("PUT", "/api/calibrations/current", {"id": "cal"}),
)


@pytest.mark.parametrize(("method", "path", "body"), NEEDS_IT)
def test_what_another_one_holds_is_refused_by_name_with_a_remedy(
    server: Serving, method: str, path: str, body: dict[str, object]
) -> None:
    use_a_calibration(server)
    assert server.http.put("/api/rig/control", headers=ANN).json()["holder"] == "ann@lab"
    for headers in (BOB, {}):
        answer = server.http.request(method, path, json=body, headers=headers)
        assert (answer.status_code, answer.json()["code"]) == (423, "control_held")
        assert "ann@lab holds control" in answer.json()["detail"]
        assert "take control over" in answer.json()["remedy"]
    assert server.services.acquisition.status().resting
    assert server.http.request(method, path, json=body, headers=ANN).status_code in (200, 201)
    server.http.post("/api/rig/abort", headers=BOB)
    server.wait()


def test_the_first_action_takes_it_and_it_can_be_taken_over_and_given_back(server: Serving) -> None:
    assert server.http.get("/api/rig/control").json()["holder"] is None
    assert server.http.put("/api/rig/live", json={"rate_hz": 5}, headers=ANN).status_code == 200
    assert server.http.get("/api/rig/control", headers=ANN).json()["mine"] is True
    assert server.http.delete("/api/rig/live", headers=BOB).status_code == 202
    server.wait()
    assert server.http.put("/api/rig/control", headers=BOB).json()["holder"] == "bob@lab"
    assert server.http.delete("/api/rig/control", headers=ANN).json()["holder"] == "bob@lab"
    assert server.http.delete("/api/rig/control", headers=BOB).json()["holder"] is None
    events = server.services.events.since(0)
    assert [event.data["text"] for event in events if event.name == "control"][:2] == [
        "ann@lab holds control",
        "bob@lab has taken control from ann@lab",
    ]
    deeds = [(event.data["who"], event.data["text"]) for event in events if event.name == "deed"]
    assert deeds == [("ann@lab", "started live"), ("bob@lab", "ended the live view")]


def test_stop_and_abort_never_ask_for_it(server: Serving) -> None:
    for verb, outcome in (("stop", "stopped"), ("abort", "aborted")):
        started = server.http.post("/api/runs", json=plan_of(kind="dark", shots=1000), headers=ANN)
        assert server.http.post(f"{started.headers['location']}/{verb}", headers=BOB).status_code == 202
        assert server.wait().outcome == outcome


def test_a_script_without_a_name_cannot_take_it(server: Serving) -> None:
    answer = server.http.put("/api/rig/control")
    assert (answer.status_code, answer.json()["code"]) == (422, "no_name")


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    with serving(tmp_path_factory.mktemp("roles") / "runs", token="operate", viewer_token="look") as server:
        yield server


def test_a_viewer_looks_and_aborts_and_does_nothing_else(guarded: Serving) -> None:
    viewer = {"Authorization": "Bearer look"}
    for path in ("/api/rig", "/api/runs", "/api/rig/control"):
        assert guarded.http.get(path, headers=viewer).status_code == 200
    assert guarded.http.get("/api/rig/control", headers=viewer).json()["role"] == "viewer"
    others: tuple[tuple[str, str, dict[str, object]], ...] = (
        ("PUT", "/api/rig/control", {}),
        ("POST", "/api/jobs", {"run_id": "x"}),
        ("PUT", "/api/runs/x/notes", {"notes": {}}),
    )
    for method, path, body in (*NEEDS_IT, *others):
        answer = guarded.http.request(method, path, json=body, headers=viewer)
        assert (answer.status_code, answer.json()["code"]) == (403, "viewer"), path
        assert answer.json()["remedy"] == "sign in with the token of an operator"
    assert guarded.http.post("/api/rig/abort", headers=viewer).status_code == 202
    assert guarded.http.post("/api/rig/readiness", json=plan_of(), headers=viewer).status_code == 200


def test_a_browser_signs_in_with_a_random_session_and_out_again(guarded: Serving) -> None:
    with httpx.Client(base_url=guarded.http.base_url) as browser:
        signed_in = browser.post("/sign-in", data={"token": "operate", "name": "ann"})
        cookie = signed_in.headers["set-cookie"]
        assert "operate" not in cookie
        assert "Max-Age=" in cookie
        assert browser.put("/api/rig/control").json()["holder"] == "ann"
        assert browser.post("/sign-out").status_code == 303
        assert browser.get("/api/rig").status_code == 401
        stale = browser.get("/api/rig", headers={"Cookie": cookie.partition(";")[0]})
        assert stale.status_code == 401, "what the browser had is worth nothing any more"
    assert guarded.http.get("/api/rig/control", headers={"Authorization": "Bearer look"}).json()["holder"] is None


def test_whoever_tries_tokens_has_to_wait_and_sessions_go_on(tmp_path: Path) -> None:
    with serving(tmp_path / "runs", token="operate") as server, httpx.Client(base_url=server.http.base_url) as browser:
        assert browser.post("/sign-in", data={"token": "operate"}).status_code == 303
        for _ in range(MOST):
            assert server.http.get("/api/rig", headers={"Authorization": "Bearer wrong"}).status_code == 401
        for answer in (
            server.http.get("/api/rig", headers={"Authorization": "Bearer operate"}),
            server.http.post("/sign-in", data={"token": "operate"}),
        ):
            assert answer.status_code == 429
            assert 0 < int(answer.headers["retry-after"]) <= 60
        assert browser.get("/api/rig").status_code == 200
        assert httpx.post(f"http://127.0.0.1:{server.abort_listener.port}/abort").status_code == 200


def test_a_page_may_connect_to_this_server_and_the_port_of_abort_and_nowhere_else(server: Serving) -> None:
    policy = server.http.get("/api/rig").headers["content-security-policy"]
    (connect,) = [part for part in policy.split("; ") if part.startswith("connect-src")]
    own, door = f"127.0.0.1:{server.port}", f"127.0.0.1:{server.abort_listener.port}"
    assert connect == f"connect-src 'self' data: blob: ws://{own} wss://{own} http://{door} https://{door}"
