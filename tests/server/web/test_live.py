import asyncio
import json
import threading
import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from websockets.sync.client import ClientConnection, connect

from server.lab.duty import Duty
from server.lab.events import EventPublisher
from server.lab.live import LiveFeed
from tests.support.memory_devices import MemoryCamera
from tests.support.memory_rig import VIEWS
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
        feed = LiveFeed({}, lambda: None, lambda: looks.append(time.monotonic()))
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
