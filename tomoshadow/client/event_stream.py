"""Server-sent events: from lines to values. Pure."""

import json
from collections.abc import Iterable, Iterator

from tomoshadow.client.values import Event, read


def events_of(lines: Iterable[str], url: str) -> Iterator[Event | None]:
    """Events that the server at ``url`` streams; None for a block without data: it listens, or lives."""
    data = list[str]()
    for line in lines:
        if line.startswith("data:"):
            data.append(line.removeprefix("data:").removeprefix(" "))
        elif not line:
            yield read(_event, "\n".join(data), url) if data else None
            data.clear()


def _event(text: str) -> Event:
    return Event.of(json.loads(text))
