"""A request that brings too much is refused before it is kept, whether it says how much it brings or not."""

import http.client
from collections.abc import Iterator

import pytest

from server.web.body_limit import MOST_BYTES
from tests.support.serving import DEADLINE_S, Serving, plan_of

PIECE = bytes(50_000)


def endless(sent: list[int]) -> Iterator[bytes]:
    while len(sent) * len(PIECE) < 30 * MOST_BYTES:
        sent.append(len(PIECE))
        yield PIECE


@pytest.mark.parametrize("path", ["/api/runs", "/api/rig/abort", "/api/nothing"])
def test_a_body_that_says_it_is_too_large_is_not_waited_for(server: Serving, path: str) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=DEADLINE_S)
    connection.putrequest("POST", path)
    connection.putheader("Content-Length", str(300 * MOST_BYTES))
    connection.endheaders(b"{")
    with connection.getresponse() as answer:
        text = answer.read().decode()
        assert (answer.status, answer.headers["content-type"]) == (413, "application/problem+json"), text
    connection.close()
    assert "larger than 1000000 bytes" in text


def test_a_body_that_does_not_say_so_is_refused_when_it_is_too_large(server: Serving) -> None:
    answer = server.http.post("/api/runs", content=endless([]), headers={"Content-Type": "application/json"})
    assert (answer.status_code, answer.headers["content-type"]) == (413, "application/problem+json")
    assert "larger than 1000000 bytes" in answer.json()["detail"]


def test_the_longest_plan_passes(server: Serving) -> None:
    answer = server.http.post("/api/rig/readiness", json=plan_of(stage_z_mm=[float(z) / 7 for z in range(1000)]))
    assert answer.status_code == 200, answer.text
    assert len(answer.request.content) < MOST_BYTES / 10
