"""Who may talk to the server: every door, http and websocket, is tried with every kind of visitor."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin

from server.web.app import create_api
from server.web.guard import COOKIE, is_ours
from tests.support.serving import Serving, assembled, listening, serving

TOKEN = "correct horse battery staple"


@pytest.fixture(scope="module")
def with_token(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    with serving(tmp_path_factory.mktemp("guard") / "runs", token=TOKEN) as server:
        yield server


@pytest.fixture
def guarded(with_token: Serving) -> Serving:
    """Its client is signed in by no earlier test."""
    with_token.http.cookies.clear()
    return with_token


def bearer(token: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {token}"}


@pytest.mark.parametrize("path", ["/api/rig", "/api/runs", "/api/events", "/api/nothing", "/api/openapi.json", "/"])
def test_without_the_token_every_path_is_closed(guarded: Serving, path: str) -> None:
    for headers in ({}, bearer("wrong"), {"Cookie": f"{COOKIE}=wrong"}):
        answer = guarded.http.get(path, headers=headers)
        assert (answer.status_code, answer.headers["content-type"]) == (401, "application/problem+json")
        assert answer.headers["www-authenticate"] == "Bearer"


@pytest.mark.parametrize("path", ["/api/rig/abort", "/api/runs/20261129T093000-spray/abort"])
def test_who_has_no_token_is_told_where_everybody_may_end_the_light(guarded: Serving, path: str) -> None:
    refused = guarded.http.post(path)
    assert (refused.status_code, refused.json()["code"]) == (401, "token")
    door = f"http://127.0.0.1:{guarded.abort_listener.port}/abort"
    assert refused.json()["remedy"].startswith(f"POST {door}, which needs no token; or set TOMOSHADOW_TOKEN")
    assert httpx.post(door, timeout=60).json()["light"] == "off"
    assert "abort" not in guarded.http.post("/api/runs", json={}).json()["remedy"]


def test_with_the_token_scripts_come_in(guarded: Serving) -> None:
    assert guarded.http.get("/api/rig", headers=bearer(TOKEN)).status_code == 200


def test_a_browser_is_led_to_the_form_and_gets_a_cookie_that_scripts_cannot_read(guarded: Serving) -> None:
    with httpx.Client(base_url=guarded.http.base_url) as browser:
        led = browser.get("/", headers={"Accept": "text/html"})
        assert (led.status_code, led.headers["location"]) == (303, "/sign-in?page=%2F")
        assert "password" in browser.get("/sign-in").text
        assert browser.post("/sign-in", data={"token": "wrong"}).status_code == 401
        signed_in = browser.post("/sign-in", data={"token": TOKEN})
        cookie = signed_in.headers["set-cookie"].lower()
        assert "httponly" in cookie
        assert "samesite=strict" in cookie
        assert browser.get("/api/rig").status_code == 200


def test_who_signs_in_comes_to_the_page_that_was_asked_for(guarded: Serving) -> None:
    with httpx.Client(base_url=guarded.http.base_url) as browser:
        way = browser.get("/runs/20260101T000000-spray/shots/7", headers={"Accept": "text/html"}).headers["location"]
        signed_in = browser.post(way, data={"token": TOKEN})
    assert signed_in.headers["location"] == "/runs/20260101T000000-spray/shots/7"


@pytest.mark.parametrize(
    "page", ["//evil.example", "https://evil.example", "/\\evil.example", "", "/a?b", "/a\r\nb", "/%0a"]
)
def test_signing_in_leads_to_no_other_server(guarded: Serving, page: str) -> None:
    answer = guarded.http.post("/sign-in", params={"page": page}, data={"token": TOKEN})
    assert (answer.status_code, answer.headers["location"]) == (303, "/")


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "http://evil.example:8080"},
        {"Origin": "null"},
        {"Origin": "http://[::1"},
        {"Origin": "http://127.0.0.1:1"},
    ],
)
def test_foreign_pages_are_refused_token_or_not(guarded: Serving, headers: dict[str, str]) -> None:
    answer = guarded.http.post("/api/rig/abort", headers={**bearer(TOKEN), **headers})
    assert answer.status_code == 403, answer.text


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "", "[::1"])
def test_without_a_token_a_foreign_name_of_this_machine_is_refused(server: Serving, host: str) -> None:
    assert server.http.get("/api/rig", headers={"Host": host}).status_code == 403


def test_with_a_token_the_server_may_have_any_name(guarded: Serving) -> None:
    assert guarded.http.get("/api/rig", headers={**bearer(TOKEN), "Host": "lab-pc.example"}).status_code == 200


def test_the_page_of_this_server_is_its_own_origin(guarded: Serving) -> None:
    headers = {**bearer(TOKEN), "Origin": str(guarded.http.base_url).rstrip("/")}
    assert guarded.http.get("/api/rig", headers=headers).status_code == 200


@pytest.mark.parametrize("headers", [{}, bearer("wrong")])
def test_the_live_socket_is_guarded_too(guarded: Serving, headers: dict[str, str]) -> None:
    with pytest.raises(InvalidStatus), connect(f"ws://127.0.0.1:{guarded.port}/api/live", additional_headers=headers):
        pass


def test_a_foreign_page_cannot_open_the_live_socket(server: Serving) -> None:
    with (
        pytest.raises(InvalidStatus),
        connect(f"ws://127.0.0.1:{server.port}/api/live", origin=Origin("http://evil.example")),
    ):
        pass


def test_the_token_does_not_show_in_the_configuration(guarded: Serving) -> None:
    answer = guarded.http.get("/api/rig/configuration", headers=bearer(TOKEN))
    assert TOKEN not in answer.text


@pytest.mark.parametrize("path", ["/api/rig", "/api/nothing", "/sign-in"])
def test_no_other_page_shows_ours_in_a_frame_and_no_browser_guesses_what_an_answer_is(
    guarded: Serving, path: str
) -> None:
    for headers in (bearer(TOKEN), bearer("wrong")):
        answer = guarded.http.get(path, headers=headers)
        assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]
        assert answer.headers["x-content-type-options"] == "nosniff"


@given(st.text(max_size=40))
def test_no_host_but_a_loopback_name_is_ours(host: str) -> None:
    is_plain_loopback = host in ("localhost", "127.0.0.1") or host.startswith(("localhost:", "127.", "[::1]"))
    if is_ours(host):
        assert is_plain_loopback or host.lower().startswith("localhost")


def test_host_names_can_be_added(tmp_path: Path) -> None:
    assert is_ours("Lab-PC:8080", ["lab-pc"])
    assert not is_ours("lab-pc.example:8080", ["lab-pc"])
    with (
        assembled(tmp_path / "runs") as services,
        listening(create_api(replace(services, host_names=("Lab-PC",)))) as port,
    ):
        answer = httpx.get(f"http://127.0.0.1:{port}/api/rig", headers={"Host": "lab-pc"})
    assert answer.status_code == 200


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_what_another_page_embeds_is_refused_and_a_link_is_followed(server: Serving, site: str) -> None:
    """Such a GET names no origin, and one of a volume makes work."""
    embedded = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "no-cors"}
    assert server.http.get("/api/runs", headers=embedded).status_code == 403
    assert server.http.get("/api/runs", headers={**embedded, "Sec-Fetch-Mode": "navigate"}).status_code == 200
    for own in ("same-origin", "none"):
        assert server.http.get("/api/runs", headers={**embedded, "Sec-Fetch-Site": own}).status_code == 200


def test_who_signs_in_again_leaves_no_session_behind(guarded: Serving) -> None:
    with httpx.Client(base_url=guarded.http.base_url) as browser:
        cookies = [browser.post("/sign-in", data={"token": TOKEN}).headers["set-cookie"] for _ in range(2)]
        browser.cookies.clear()
        codes = [
            browser.get("/api/rig", headers={"Cookie": cookie.partition(";")[0]}).status_code for cookie in cookies
        ]
    assert codes == [401, 200]


def test_a_token_in_the_place_of_the_name_is_told_to_nobody(guarded: Serving) -> None:
    answer = guarded.http.post("/sign-in", data={"token": TOKEN, "name": f" {TOKEN} "})
    assert (answer.status_code, "set-cookie" in answer.headers) == (401, False)
    assert "no name" in answer.text
    assert TOKEN not in str([event.data for event in guarded.services.events.since(0)])
