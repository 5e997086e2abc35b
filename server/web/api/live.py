"""/api/live: the live view, one binary websocket for all cameras."""

import asyncio
import contextlib

from fastapi import APIRouter, WebSocket, WebSocketDisconnect

from server.lab.live import LiveFeed
from server.web.api.parameters import ContextOf

router = APIRouter()
LIVE_PATH = "/api/live"


@router.websocket(LIVE_PATH)
async def follow_cameras(socket: WebSocket, context: ContextOf) -> None:
    """One byte with the number of the view, then a JPEG."""
    await socket.accept()
    work = [asyncio.create_task(_send(socket, context.live)), asyncio.create_task(_closed(socket))]
    try:
        await asyncio.wait(work, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in work:
            task.cancel()
        await asyncio.wait(work)


async def _send(socket: WebSocket, live: LiveFeed) -> None:
    async with contextlib.aclosing(live.pictures()) as pictures:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):  # the page left while we were sending
            async for picture in pictures:
                await socket.send_bytes(picture)


async def _closed(socket: WebSocket) -> None:
    """Wait until the page has closed its end; what it says before is nothing to us."""
    while (await socket.receive())["type"] != "websocket.disconnect":
        continue
