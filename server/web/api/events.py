"""/api/events: what happens, as server-sent events for scripts.

The page has a socket of its own: a browser allows six connections per host, and every open stream takes one of them.
"""

import json
from collections.abc import AsyncIterator
from dataclasses import asdict
from typing import Annotated

from fastapi import APIRouter, Header
from fastapi.responses import StreamingResponse

from server.lab.events import Event, EventPublisher
from server.web.api.parameters import ContextOf
from server.web.problems import responses

router = APIRouter(prefix="/api/events", tags=["events"])


@router.get(
    "", response_class=StreamingResponse, responses={**responses(429), 200: {"content": {"text/event-stream": {}}}}
)
async def follow_events(
    context: ContextOf, last_event_id: Annotated[int | None, Header(ge=0, description="resume after this event")] = None
) -> StreamingResponse:
    """Events from now on, or after the last one that the reader has seen."""
    events = context.services.events
    stream = _lines(events, events.newest if last_event_id is None else last_event_id)
    return StreamingResponse(stream, media_type="text/event-stream", headers={"Cache-Control": "no-store"})


async def _lines(events: EventPublisher, last_id: int) -> AsyncIterator[str]:
    yield "retry: 2000\n\n"
    async for event in events.follow(last_id):
        yield ": alive\n\n" if event is None else _block(event)


def _block(event: Event) -> str:
    return f"id: {event.id}\nevent: {event.name}\ndata: {json.dumps(asdict(event))}\n\n"
