import asyncio
import itertools
import json
import threading
from collections.abc import AsyncIterator, Iterator
from typing import Any

import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st

from daq.run.events import ShotRecorded
from server.lab.events import Event, EventPublisher
from tests.support.serving import Serving, plan_of


@given(st.integers(0, 30), st.integers(1, 10), st.integers(0, 40))
def test_a_reader_gets_what_is_kept_after_the_last_event_it_saw(published: int, history: int, last_id: int) -> None:
    events = EventPublisher(history)
    for number in range(published):
        events.publish("tick", number=number)
    ids = [event.id for event in events.since(last_id)]
    kept = list(range(max(1, published - history + 1), published + 1))
    assert ids == ([id for id in kept if id > last_id] if last_id <= published else kept)


def test_events_of_many_threads_reach_every_reader_in_one_order() -> None:
    events = EventPublisher()

    async def read(count: int) -> list[int]:
        return [event.id async for event in _take(events, count)]

    async def go() -> list[list[int]]:
        events.attach()
        readers = [asyncio.create_task(read(60)) for _ in range(3)]
        threads = [threading.Thread(target=_publish, args=(events, 20)) for _ in range(3)]
        for thread in threads:
            thread.start()
        read_ids = await asyncio.wait_for(asyncio.gather(*readers), 5)
        for thread in threads:
            thread.join()
        return list(read_ids)

    assert asyncio.run(go()) == [list(range(1, 61))] * 3


def test_readers_end_when_the_server_does() -> None:
    events = EventPublisher()

    async def go() -> None:
        events.attach()
        reader = asyncio.create_task(_all(events))
        await asyncio.sleep(0)
        last = events.publish("last")
        events.detach()
        assert await asyncio.wait_for(reader, 5) == [last]

    asyncio.run(go())


def test_what_acquisition_says_becomes_an_event() -> None:
    events = EventPublisher()
    events.publish_run_event(ShotRecorded("run", 3, False, "no exposure B of view2"))
    (event,) = events.since(0)
    assert (event.name, dict(event.data)) == (
        "shot_recorded",
        {"run_id": "run", "index": 3, "valid": False, "fault": "no exposure B of view2"},
    )


def test_a_script_follows_a_run_and_resumes_where_it_was(server: Serving) -> None:
    server.run_to_its_end(plan_of(shots=2))
    with server.http.stream("GET", "/api/events", headers={"Last-Event-ID": "0"}) as stream:
        assert stream.headers["content-type"].startswith("text/event-stream")
        seen = list(itertools.islice(_messages(stream), 4))
    assert {event["name"] for event in seen} <= {"run_state", "shot_recorded", "deed"}
    with server.http.stream("GET", "/api/events", headers={"Last-Event-ID": str(seen[1]["id"])}) as stream:
        assert list(itertools.islice(_messages(stream), 2)) == seen[2:]


def test_a_number_that_is_none_is_refused(server: Serving) -> None:
    assert server.http.get("/api/events", headers={"Last-Event-ID": "x"}).status_code == 422


def _publish(events: EventPublisher, count: int) -> None:
    for number in range(count):
        events.publish("tick", number=number)


async def _take(events: EventPublisher, count: int) -> AsyncIterator[Event]:
    async for event in events.follow(0):
        if event is not None:
            yield event
            count -= 1
        if count == 0:
            return


async def _all(events: EventPublisher) -> list[object]:
    return [event async for event in events.follow(0)]


def _messages(stream: httpx.Response) -> Iterator[dict[str, Any]]:
    for line in stream.iter_lines():
        if line.startswith("data: "):
            yield json.loads(line.removeprefix("data: "))


@pytest.mark.parametrize("last_id", [0, 5])
def test_nothing_published_is_nothing_to_read(last_id: int) -> None:
    assert EventPublisher().since(last_id) == []
