"""Who holds too many streams gets no more of them, until one is closed."""

from contextlib import ExitStack

import httpx
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from server.web.stream_cap import MOST_STREAMS
from tests.support.server_process import eventually
from tests.support.serving import DEADLINE_S, Serving


def test_streams_of_one_address_are_counted(server: Serving) -> None:
    beat = f"ws://127.0.0.1:{server.port}/api/beat"

    def follow() -> int:
        with server.http.stream("GET", "/api/events") as answer:
            return answer.status_code

    with ExitStack() as streams:
        for _ in range(MOST_STREAMS):
            socket = streams.enter_context(connect(beat, open_timeout=DEADLINE_S))
        with pytest.raises(InvalidStatus) as refused:
            connect(beat)
        assert refused.value.response.status_code == 429
        answer = server.http.get("/api/events")
        assert (answer.status_code, answer.headers["content-type"]) == (429, "application/problem+json")
        assert "127.0.0.1 has 64 open streams" in answer.json()["detail"]
        assert server.http.get("/api/rig").status_code == 200
        with (
            httpx.Client(transport=httpx.HTTPTransport(local_address="127.0.0.2")) as other,
            other.stream("GET", f"{server.http.base_url}/api/events") as elsewhere,
        ):
            assert elsewhere.status_code == 200
        socket.close()
        eventually(lambda: follow() == 200, "there is room again")
