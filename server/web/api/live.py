"""/api/live: the live view, one binary websocket for all cameras."""

import asyncio
import contextlib

from fastapi import APIRouter, WebSocket, WebSocketDisconnect
from pydantic import TypeAdapter, ValidationError
from starlette.status import WS_1008_POLICY_VIOLATION

from server.lab.live_view.live_feed import LiveFeed, LiveReader, Tile
from server.web.api.parameters import ContextOf

router = APIRouter()
LIVE_PATH = "/api/live"
_WISH: TypeAdapter[dict[str, Tile]] = TypeAdapter(dict[str, Tile])


@router.websocket(LIVE_PATH)
async def follow_cameras(socket: WebSocket, context: ContextOf) -> None:
    """Pictures, see ``server.lab.live_view.live_feed``.

    The reader may say, in JSON and again and again, what it wants to see: ``{"view1": {"exposure": "a", "scale":
    "auto"}}``; at first it gets exposure B of all views in full scale. A view that it does not name costs nothing.
    """
    await socket.accept()
    reader = context.live.reader()
    work = [
        asyncio.create_task(_send(socket, context.live, reader)),
        asyncio.create_task(_hear(socket, context.live, reader)),
    ]
    try:
        await asyncio.wait(work, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in work:
            task.cancel()
        await asyncio.wait(work)


async def _send(socket: WebSocket, live: LiveFeed, reader: LiveReader) -> None:
    async with contextlib.aclosing(live.pictures(reader)) as pictures:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):  # the page left while we were sending
            async for picture in pictures:
                await socket.send_bytes(picture)


async def _hear(socket: WebSocket, live: LiveFeed, reader: LiveReader) -> None:
    """Take wishes until the page has closed its end; what is none ends the connection."""
    while (said := await socket.receive())["type"] != "websocket.disconnect":
        try:
            live.wish(reader, _WISH.validate_json(said.get("text") or ""))
        except ValidationError as error:
            problem = f"no wish of a live view: {error.errors()[0]['msg']}"
            await socket.close(WS_1008_POLICY_VIOLATION, problem[:120])
            return
