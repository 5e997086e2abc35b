"""Who asks for nothing, or slowly, or says that he is somebody else, holds nobody up."""

import asyncio
import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import httpx
import pytest
import uvicorn
from starlette.types import Receive, Scope, Send
from uvicorn.server import ServerState
from websockets.sync.client import connect

from server.web import abort_listener, body_limit, connections
from server.web.tries import MOST
from tests.support.serving import Serving, listening, serving

LIMIT_S = 60.0


@pytest.fixture
def hasty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Serving]:
    """A server that waits for nobody."""
    for module, name in ((connections, "REQUEST_S"), (abort_listener, "REQUEST_S"), (body_limit, "BODY_S")):
        monkeypatch.setattr(module, name, 0.5)
    with serving(tmp_path / "runs") as server:
        yield server


def connected(port: int) -> socket.socket:
    connection = socket.create_connection(("127.0.0.1", port), LIMIT_S)
    connection.settimeout(LIMIT_S)
    return connection


@pytest.mark.parametrize("begun", [b"", b"POST /api/rig/abort HTTP/1.1\r\nHost: local"])
def test_a_connection_that_asks_for_nothing_is_closed(hasty: Serving, begun: bytes) -> None:
    for port in (hasty.port, hasty.abort_listener.port):
        with connected(port) as connection:
            connection.sendall(begun)
            assert connection.recv(100) == b""


def test_a_socket_stays_open(hasty: Serving) -> None:
    with connect(f"ws://127.0.0.1:{hasty.port}/api/beat") as beats:
        for _ in range(4):  # a second
            beats.recv(LIMIT_S)


def test_a_body_that_does_not_come_is_not_waited_for(hasty: Serving) -> None:
    with connected(hasty.port) as connection:
        head = f"POST /api/runs HTTP/1.1\r\nHost: 127.0.0.1:{hasty.port}\r\nContent-Type: application/json"
        connection.sendall(f"{head}\r\nContent-Length: 1000\r\n\r\n{{".encode())
        answer = b"".join(iter(lambda: connection.recv(10_000), b""))
    assert answer.startswith(b"HTTP/1.1 408 ")
    assert b"did not come" in answer


@pytest.mark.parametrize("port_of", [lambda server: server.port, lambda server: server.abort_listener.port])
def test_however_many_ask_for_nothing_the_next_one_is_heard(server: Serving, port_of: object) -> None:
    assert callable(port_of)
    port = port_of(server)
    idle = [connected(port) for _ in range(connections.MOST + 20)]
    try:
        path = "/api/rig" if port == server.port else "/abort"
        answer = httpx.request("GET" if port == server.port else "POST", f"http://127.0.0.1:{port}{path}", timeout=60)
        assert answer.status_code == 200, answer.text
        assert idle[0].recv(100) == b""
        assert server.http.get("/api/rig").status_code == 200
    finally:
        for connection in idle:
            connection.close()


def test_nobody_who_says_that_he_comes_from_elsewhere_may_try_more_tokens(tmp_path: Path) -> None:
    with serving(tmp_path / "runs", token="correct horse") as server:
        for number in range(MOST):
            headers = {"X-Forwarded-For": f"10.0.0.{number}"}
            assert server.http.post("/sign-in", data={"token": "wrong"}, headers=headers).status_code == 401
        assert (
            server.http.post("/sign-in", data={"token": "wrong"}, headers={"X-Forwarded-For": "::1"}).status_code == 429
        )


def test_who_asks_for_much_and_reads_nothing_is_let_go(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "STALLED_S", 0.3)
    ended = threading.Event()

    async def endless(scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            sending = asyncio.create_task(keep_sending(send))
            while (await receive())["type"] != "http.disconnect":
                pass
            sending.cancel()
            ended.set()

    async def keep_sending(send: Send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        while True:
            await send({"type": "http.response.body", "body": bytes(65536), "more_body": True})

    app: Any = endless
    with listening(app) as port, socket.create_connection(("127.0.0.1", port)) as reader:
        reader.sendall(b"GET / HTTP/1.1\r\nHost: here\r\n\r\n")
        assert ended.wait(20)


async def _closed_by_both(config: uvicorn.Config) -> bytes:
    """What a page is told that closes its socket in the very moment in which the server ends."""
    loop, protocol = asyncio.get_running_loop(), cast(Any, config.ws_protocol_class)(config, ServerState(), {})
    async with await loop.create_server(lambda: protocol, "127.0.0.1", 0) as listener:
        reader, writer = await asyncio.open_connection(*listener.sockets[0].getsockname())
        head = "GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13"
        writer.write(f"{head}\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n".encode())
        await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), LIMIT_S)
        protocol.data_received(bytes([0x88, 0x82, 0, 0, 0, 0, 0x03, 0xE9]))
        protocol.shutdown()
        said = await asyncio.wait_for(reader.read(), LIMIT_S)
        writer.close()
    return said


def test_a_page_that_closes_while_the_server_ends_breaks_off_nothing() -> None:
    async def accept(_scope: Scope, receive: Receive, send: Send) -> None:
        await receive()
        await send({"type": "websocket.accept"})
        await receive()

    config = connections.config_of(accept, log_level="error")  # type: ignore[arg-type]
    config.load()
    assert asyncio.run(_closed_by_both(config)) == bytes([0x88, 0x02, 0x03, 0xE9])
