"""/api/beat: the pulse of the server, for pages: a number every quarter of a second, by a websocket of its own."""

import contextlib

from fastapi import APIRouter, WebSocket, WebSocketDisconnect

from server.lab.desk.beat import PERIOD_S
from server.lab.duty import pause
from server.web.api.parameters import ContextOf

router = APIRouter()
BEAT_PATH = "/api/beat"


@router.websocket(BEAT_PATH)
async def follow_beat(socket: WebSocket, context: ContextOf) -> None:
    """The number of the beat, again and again."""
    await socket.accept()
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):  # the page left while we were sending
        while True:
            await socket.send_text(str(context.beat.number))
            await pause(PERIOD_S)
