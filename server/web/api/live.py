"""/api/live: the live view, one binary websocket for all cameras."""

from fastapi import APIRouter, WebSocket

from server.lab.live import LIVE_PATH
from server.web.api.parameters import ContextOf

router = APIRouter()


@router.websocket(LIVE_PATH)
async def follow_cameras(socket: WebSocket, context: ContextOf) -> None:
    """One byte with the number of the view, then a JPEG."""
    await context.live.serve(socket)
