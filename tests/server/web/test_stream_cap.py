"""Who holds too many streams gets no more of them, until one is closed."""

import asyncio
from collections import Counter
from contextlib import ExitStack

import httpx
import pytest
from starlette.types import Message, Receive, Scope, Send
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from server.web.stream_cap import MOST_MESHES, MOST_STREAMS, StreamCap
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


def test_meshes_of_one_address_are_counted_while_they_are_made() -> None:
    asyncio.run(ask_for_meshes())


async def ask_for_meshes() -> None:
    leave, statuses = asyncio.Event(), Counter[int]()

    async def make(scope: Scope, receive: Receive, send: Send) -> None:
        await leave.wait()
        await send({"type": "http.response.start", "status": 200, "headers": []})

    async def tell(message: Message) -> None:
        statuses[message.get("status", 0)] += 1

    cap, scope = StreamCap(make), {"type": "http", "client": ("10.0.0.1", 1), "headers": [], "query_string": b""}
    mesh = scope | {"path": "/api/runs/a/results/b/shot_00000_a/surface.glb", "server": ("x", 1), "scheme": "http"}
    asked = [asyncio.create_task(cap(mesh, receive_nothing, tell)) for _ in range(MOST_MESHES + 2)]
    await asyncio.sleep(0)
    assert statuses[429] == 2
    leave.set()
    await asyncio.gather(*asked)
    await cap(mesh, receive_nothing, tell)
    assert statuses[200] == MOST_MESHES + 1


async def receive_nothing() -> Message:
    return {}
