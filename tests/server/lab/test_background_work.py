"""Work in the background goes on whatever happens to it, and has a red lamp with the reason while it does not."""

import sqlite3
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI
from websockets.sync.client import connect

from daq.devices import GeneratorStatus
from daq.run.events import ShotRecorded
from server.lab.jobs.job import JobKind
from server.lab.services import Services
from server.web.app import create_api
from tests.server.web.test_api import use_a_calibration, wait_for_jobs
from tests.support.memory_devices import MemoryCamera, MemoryGenerator
from tests.support.serving import DEADLINE_S, Serving, plan_of, serving, write_spray


def lamps(server: Serving) -> dict[str, dict[str, str]]:
    return {lamp["name"]: lamp for lamp in server.http.get("/api/rig").json()["lamps"]}


def eventually(is_so: Callable[[], bool]) -> bool:
    """Whether it becomes so before the deadline."""
    end_s = time.monotonic() + DEADLINE_S
    while not is_so():
        if time.monotonic() > end_s:
            return False
        time.sleep(0.05)
    return True


def told(server: Serving) -> list[tuple[str, str | None]]:
    """What the events say of work in the background: which, and what is wrong, if anything."""
    events = server.services.events.since(0)
    return [(event.data["work"], event.data["error"]) for event in events if event.name == "background_work"]


def test_a_shot_that_cannot_be_reconstructed_by_itself_does_not_end_automatic_reconstruction(server: Serving) -> None:
    use_a_calibration(server)
    server.services.events.publish_run_event(ShotRecorded("gone", 0, valid=True))
    assert eventually(lambda: "automatic reconstruction" in lamps(server)), "no lamp tells of the lost shot"
    lamp = lamps(server)["automatic reconstruction"]
    assert (lamp["health"], lamp["kind"]) == ("fault", "work")
    assert "there is no run 'gone'" in lamp["detail"]
    server.run_to_its_end(plan_of(shots=1))
    assert [job["state"] for job in wait_for_jobs(server, 1)] == ["done"]
    assert "automatic reconstruction" not in lamps(server)
    assert [error for work, error in told(server) if work == "automatic reconstruction"][-1] is None


def without_checks(services: Services) -> FastAPI:
    return create_api(replace(services, tasks={JobKind.RECONSTRUCTION: write_spray}))


def test_a_job_that_the_server_cannot_do_fails_and_the_next_one_is_done(tmp_path: Path) -> None:
    with serving(tmp_path / "runs", build=without_checks) as server:
        use_a_calibration(server)
        server.run_to_its_end(plan_of(shots=1))
        assert [job["state"] for job in wait_for_jobs(server, 1)] == ["done"]
        (check,) = wait_for_jobs(server, 1, "check")
        assert (check["state"], check["error"].split(":")[0]) == ("failed", "KeyError")


def test_a_row_that_is_no_job_stops_no_job(tmp_path: Path) -> None:
    with serving(tmp_path / "runs") as server:
        use_a_calibration(server)
    with sqlite3.connect(tmp_path / "runs" / "jobs.sqlite") as table:
        values = ("strange", "run", "queued", '{"kind": "check", "of": "another version"}')
        table.execute("INSERT INTO job (id, run_id, state, document) VALUES (?, ?, ?, ?)", values)
    table.close()
    with serving(tmp_path / "runs") as server:
        server.run_to_its_end(plan_of(shots=1))
        assert [job["state"] for job in wait_for_jobs(server, 1)] == ["done"]
        assert server.http.get("/api/jobs").status_code == 200


def _fail_once(device: Any, name: str, error: Exception) -> None:
    """Let a question to a device end by an error that its driver does not know, once."""
    answer = getattr(device, name)

    def fail() -> object:
        setattr(device, name, answer)
        raise error

    setattr(device, name, fail)


def test_an_error_of_a_driver_does_not_freeze_the_lamps(server: Serving) -> None:
    generator = server.services.rig.generator
    assert isinstance(generator, MemoryGenerator)
    _fail_once(generator, "status", ZeroDivisionError("in the driver"))
    assert eventually(lambda: "status" not in vars(generator) or generator.status.__name__ != "fail")
    server.http.put("/api/bench/door", json={"open": True})
    assert eventually(lambda: lamps(server)["interlock"]["health"] == "fault"), "the lamps are frozen"


def test_lamps_that_nobody_has_answered_for_a_while_are_not_green(server: Serving) -> None:
    generator, hangs = server.services.rig.generator, threading.Event()
    assert isinstance(generator, MemoryGenerator)
    answer = generator.status

    def wait() -> GeneratorStatus:
        hangs.wait(2 * DEADLINE_S)
        return answer()

    generator.status = wait  # type: ignore[method-assign]
    try:
        assert eventually(lambda: lamps(server)["pulse generator"]["health"] != "ok"), "the lamps are frozen, and green"
        assert "no answer for" in lamps(server)["pulse generator"]["detail"]
        assert eventually(lambda: lamps(server)["view1"]["health"] == "ok"), "one slow device made the others old"
    finally:
        hangs.set()
    assert eventually(lambda: lamps(server)["pulse generator"]["health"] == "ok")


def test_a_picture_that_cannot_be_made_does_not_end_the_live_view(server: Serving) -> None:
    camera = server.services.rig.cameras["view1"]
    assert isinstance(camera, MemoryCamera)
    bits, camera.bits = camera.bits, 0  # nothing is white then
    with connect(f"ws://127.0.0.1:{server.port}/api/live") as reader:
        server.run_to_its_end(plan_of(shots=1))
        assert _views_of(reader, 1) == {1}, "view2 has no picture"
        assert "view1: ZeroDivisionError" in lamps(server)["live view"]["detail"]
        camera.bits = bits
        server.run_to_its_end(plan_of(shots=1))
        assert _views_of(reader, 2) == {0, 1}
    assert eventually(lambda: "live view" not in lamps(server))


def _views_of(reader: Any, count: int) -> set[int]:
    """Numbers of the views of the next pictures; fewer where none come."""
    views = set()
    for _ in range(count):
        try:
            views.add(reader.recv(DEADLINE_S / 4)[0])
        except TimeoutError:
            break
    return views


@pytest.mark.parametrize("folder", ["runs"])
def test_a_disk_that_has_gone_is_a_red_lamp(server: Serving, folder: str, tmp_path: Path) -> None:
    (tmp_path / folder).rename(tmp_path / "elsewhere")
    assert eventually(lambda: lamps(server)["disk"]["health"] == "fault")
    assert "No such file" in lamps(server)["disk"]["detail"]
    (tmp_path / "elsewhere").rename(tmp_path / folder)
    assert eventually(lambda: lamps(server)["disk"]["health"] != "fault")
