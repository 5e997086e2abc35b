"""Server-sent events: from lines to values. Pure."""

import json
from collections.abc import Iterable, Iterator

from tomoshadow.client.values import Event


def events_of(lines: Iterable[str]) -> Iterator[Event | None]:
    """Events of a stream; None for a block without data, by which the server says that it listens, or lives."""
    data = list[str]()
    for line in lines:
        if line.startswith("data:"):
            data.append(line.removeprefix("data:").removeprefix(" "))
        elif not line:
            yield Event.of(json.loads("\n".join(data))) if data else None
            data.clear()
