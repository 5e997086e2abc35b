import asyncio
import json
import threading
import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from daq.run_plan import ImageKey
from daq.shot import DoubleFrame, ExposureRecord, Shot
from server.lab.duty import Duty
from server.lab.events import EventPublisher
from server.lab.live_view.live_feed import LiveCaption, LiveFeed, LivePicture, Tile
from tests.support.memory_devices import MemoryCamera
from tests.support.memory_rig import VIEWS, MemoryRig, served_rig
from tests.support.serving import DEADLINE_S, Serving, plan_of

PULSE = {"current_a": dict.fromkeys(VIEWS, 5)}


def received(reader: ClientConnection) -> tuple[int, dict[str, Any], Any]:
    """Number of the view, caption, picture."""
    message = reader.recv(DEADLINE_S)
    assert isinstance(message, bytes)
    end = 3 + int.from_bytes(message[1:3], "big")
    return message[0], json.loads(message[3:end]), cv2.imdecode(np.frombuffer(message[end:], np.uint8), -1)


def eventually(condition: Callable[[], bool]) -> bool:
    deadline = time.monotonic() + DEADLINE_S
    while not condition() and time.monotonic() < deadline:
        threading.Event().wait(0.05)
    return condition()


def test_every_reader_gets_the_newest_picture_of_every_view(server: Serving) -> None:
    address = f"ws://127.0.0.1:{server.port}/api/live"
    with connect(address) as first, connect(address) as second:
        server.run_to_its_end(plan_of(shots=2))
        for reader in (first, second):
            pictures: dict[int, Any] = {}
            while len(pictures) < 2:
                view, caption, picture = received(reader)
                assert caption["shot"] in (0, 1)
                pictures[view] = picture
            for picture in pictures.values():
                assert picture is not None
                assert picture.shape == (96, 128)
                assert picture.std() > 20


def test_a_reader_that_leaves_disturbs_nobody(server: Serving) -> None:
    address = f"ws://127.0.0.1:{server.port}/api/live"
    with connect(address) as staying:
        for _ in range(5):
            with connect(address):
                pass
        server.run_to_its_end(plan_of(shots=1))
        assert staying.recv(DEADLINE_S)
    assert server.http.get("/api/rig").status_code == 200


def test_the_rig_is_shown_live_and_every_picture_says_what_it_shows(server: Serving) -> None:
    camera = server.services.rig.cameras["view2"]
    assert isinstance(camera, MemoryCamera)
    camera.lost = set(range(1, 1000))
    plan = {"rate_hz": 10, "pulse": PULSE}
    with connect(f"ws://127.0.0.1:{server.port}/api/live") as reader:
        answer = server.http.put("/api/rig/live", json=plan)
        assert (answer.status_code, answer.json()["state"]) == (200, "live")
        captions = [received(reader)[:2] for _ in range(6)]
    by_view = {view: [caption for number, caption in captions if number == view] for view in (0, 1)}
    for caption in by_view[0]:
        assert 70 < caption["exposures"]["a"]["light_percent"] < 80
        assert caption["exposures"]["b"]["saturated_percent"] == 0
    assert [caption["exposures"]["b"] for caption in by_view[1]] == [None] * len(by_view[1])
    for shown_of_view in by_view.values():
        numbers = [caption["shot"] for caption in shown_of_view]
        assert numbers == sorted(set(numbers))
        assert all(-1 < caption["age_s"] < DEADLINE_S for caption in shown_of_view)
    shown = server.http.get("/api/rig/live").json()
    assert shown["plan"]["rate_hz"] == 10
    assert set(shown["views"]) == set(VIEWS)
    assert server.http.get("/api/rig").json()["acquisition"]["state"] == "live"
    assert server.http.get("/api/runs").json() == []
    assert server.http.delete("/api/rig/live").status_code == 202
    server.wait()
    assert server.http.get("/api/rig/live").json()["plan"] is None


def test_the_age_of_an_old_picture_is_told_to_who_comes_late(server: Serving) -> None:
    server.run_to_its_end(plan_of(shots=1))
    threading.Event().wait(0.3)
    with connect(f"ws://127.0.0.1:{server.port}/api/live") as reader:
        _, caption, _ = received(reader)
    assert caption["age_s"] >= 0.3


def test_a_reader_says_what_it_wants_to_see_and_gets_no_more(server: Serving) -> None:
    server.run_to_its_end(plan_of(shots=1))
    with connect(f"ws://127.0.0.1:{server.port}/api/live") as reader:
        _, caption, first = received(reader)
        assert caption["tile"] == {"exposure": "b", "scale": "full"}
        wish = {"exposure": "a", "scale": "auto"}
        reader.send(json.dumps({"view2": wish}))
        while caption["tile"] != wish:
            number, caption, picture = received(reader)
        assert number == 1
        assert int(first.max()) < 225, "a tenth above what the scene has: noise of JPEG"
        assert int(picture.max()) > 250
        reader.send(json.dumps({}))
        server.run_to_its_end(plan_of(shots=2))
        with pytest.raises(TimeoutError):
            reader.recv(1.0)


@pytest.mark.parametrize("wish", ["", "no json", '{"view1": {"exposure": "c"}}', b"\x00"])
def test_what_is_no_wish_ends_the_connection_with_a_reason(server: Serving, wish: str | bytes) -> None:
    with connect(f"ws://127.0.0.1:{server.port}/api/live") as reader:
        reader.send(wish)
        with pytest.raises(ConnectionClosed) as closed:
            reader.recv(DEADLINE_S)
        assert closed.value.rcvd is not None
        assert "no wish of a live view" in closed.value.rcvd.reason


def test_the_newest_pixels_are_had_one_to_one(server: Serving) -> None:
    assert server.http.get("/api/rig/live/view1/b.png").status_code == 404
    server.run_to_its_end(plan_of(shots=1))
    path = "/api/rig/live/view1/a.png"
    whole = cv2.imdecode(np.frombuffer(server.http.get(path).content, np.uint8), -1)
    assert whole is not None
    assert whole.shape == (96, 128)
    answer = server.http.get(path, params={"row": 30, "column": 40, "size_px": 20})
    assert answer.headers["cache-control"] == "no-store"
    part = cv2.imdecode(np.frombuffer(answer.content, np.uint8), -1)
    np.testing.assert_array_equal(part, whole[20:40, 30:50])
    corner = server.http.get(path, params={"row": 0, "column": 127, "size_px": 20})
    part = cv2.imdecode(np.frombuffer(corner.content, np.uint8), -1)
    assert part is not None
    assert part.shape == (20, 20), "beyond the edge there is black"
    np.testing.assert_array_equal(part[10:, :11], whole[:10, 117:])
    assert part[:10].max() == 0
    assert server.http.get("/api/rig/live/nobody/a.png").status_code == 404
    assert server.http.get(path, params={"size_px": 100_000}).status_code == 422


def test_what_nobody_looks_at_is_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a hidden tile neither picture nor figures are made; of one that two look at, one picture."""
    memory, shots = served_rig(), [shot_of(0)]
    made: list[tuple[str, str]] = []
    feed = LiveFeed(memory.cameras, lambda: shots[-1], lambda: None)
    encode = feed._picture

    def count(shot: Shot, view: str, tile: Tile, caption: LiveCaption) -> LivePicture:
        made.append((view, tile.exposure))
        return encode(shot, view, tile, caption)

    monkeypatch.setattr(feed, "_picture", count)

    async def look() -> None:
        work = asyncio.create_task(feed.run(Duty("live view", EventPublisher())))
        readers = [feed.reader() for _ in range(2)]
        for reader in readers:
            feed.wish(reader, {"view2": Tile(), "nobody": Tile()})
        streams = [feed.pictures(reader) for reader in readers]
        for stream in streams:
            await asyncio.wait_for(anext(stream), DEADLINE_S)
        shots.append(shot_of(1))
        for stream in streams:
            await asyncio.wait_for(anext(stream), DEADLINE_S)
            await stream.aclose()
        shots.append(shot_of(2))
        await asyncio.sleep(0.3)
        work.cancel()
        await asyncio.wait([work])

    asyncio.run(look())
    assert made == [("view2", "b")] * 2
    assert set(feed._captions) == {"view2"}


def test_a_picture_that_fails_is_tried_once_per_shot_and_hides_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    shots, tried = [shot_of(0)], list[str]()
    feed = LiveFeed(served_rig().cameras, lambda: shots[-1], lambda: None)
    encode = feed._picture

    def fail(shot: Shot, view: str, tile: Tile, caption: LiveCaption) -> LivePicture:
        tried.append(view)
        if view == "view1":
            raise ValueError("broken")
        return encode(shot, view, tile, caption)

    monkeypatch.setattr(feed, "_picture", fail)

    async def look() -> Duty:
        duty = Duty("live view", EventPublisher())
        work, stream = asyncio.create_task(feed.run(duty)), feed.pictures()
        assert (await asyncio.wait_for(anext(stream), DEADLINE_S))[0] == 1
        await asyncio.sleep(0.3)
        await stream.aclose()
        work.cancel()
        await asyncio.wait([work])
        return duty

    lamp = asyncio.run(look()).lamp
    assert lamp is not None
    assert "view1: ValueError: broken" in lamp.detail
    assert sorted(tried) == ["view1", "view2"]


def test_a_slow_reader_gets_the_newest_picture_next() -> None:
    feed, shots = LiveFeed(served_rig().cameras, lambda: shots[-1], lambda: None), [shot_of(0)]

    async def look() -> list[int]:
        work = asyncio.create_task(feed.run(Duty("live view", EventPublisher())))
        reader = feed.reader()
        feed.wish(reader, {"view1": Tile(), "view2": Tile()})
        stream, seen = feed.pictures(reader), list[int]()
        seen.append(_shot_of(await anext(stream)))
        for index in (1, 2, 3):  # while the first message is still on its way
            shots.append(shot_of(index))
            await asyncio.sleep(0.2)
        for _ in range(2):
            seen.append(_shot_of(await asyncio.wait_for(anext(stream), DEADLINE_S)))
        await stream.aclose()
        work.cancel()
        await asyncio.wait([work])
        return seen

    assert asyncio.run(look()) == [0, 3, 3]


def shot_of(index: int) -> Shot:
    image, seen = np.full((96, 128), 120, np.uint8), ExposureRecord(True, index + 1)
    frames = {view: DoubleFrame(image, image, seen, seen) for view in VIEWS}
    return Shot(index, ImageKey.SAMPLE, frames, host_time_ns=time.time_ns())


def _shot_of(message: bytes) -> int:
    return int(json.loads(message[3 : 3 + int.from_bytes(message[1:3], "big")])["shot"])


def test_light_that_the_rig_does_not_permit_is_refused(server: Serving) -> None:
    refused = server.http.put("/api/rig/live", json={"pulse": PULSE | {"separation_ns": 2000}})
    assert (refused.status_code, "separation_ns" in refused.json()["detail"]) == (422, True)
    assert server.http.put("/api/rig/live", json={"rate_hz": 50}).status_code == 422
    server.http.put("/api/bench/door", json={"open": True})
    assert server.http.put("/api/rig/live", json={}).status_code == 423
    server.http.put("/api/bench/door", json={"open": False})


def test_the_live_view_does_not_start_beside_a_run_and_its_end_does_not_end_one(server: Serving) -> None:
    server.http.post("/api/runs", json=plan_of(shots=3, rate_hz=0.2))
    assert server.http.put("/api/rig/live", json={}).status_code == 409
    server.http.delete("/api/rig/live")
    assert server.http.get("/api/rig").json()["acquisition"]["state"] in ("arming", "acquiring")
    server.http.post("/api/rig/abort")
    server.wait()


def test_a_run_that_starts_ends_the_live_view(server: Serving) -> None:
    server.http.put("/api/rig/live", json={"pulse": PULSE})
    assert eventually(lambda: bool(server.http.get("/api/rig/live").json()["views"]))
    _, status = server.run_to_its_end(plan_of(shots=1))
    assert (status.outcome, status.live) == ("completed", None)


def test_who_looks_keeps_the_live_view_going_and_nobody_else_does() -> None:
    looks: list[float] = []

    async def look_for_a_while() -> tuple[int, int]:
        feed = LiveFeed(MemoryRig().cameras, lambda: None, lambda: looks.append(time.monotonic()))
        work = asyncio.create_task(feed.run(Duty("live view", EventPublisher())))
        await asyncio.sleep(0.3)
        before = len(looks)
        reader = asyncio.create_task(anext(feed.pictures()))
        await asyncio.sleep(0.3)
        for task in (reader, work):
            task.cancel()
        await asyncio.wait([reader, work])
        return before, len(looks)

    before, after = asyncio.run(look_for_a_while())
    assert before == 0
    assert after >= 1
