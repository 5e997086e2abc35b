"""Bugs of public projects, re-enacted: what is right was known before it was tried.

6: light survives its host (Klipper #5795, LaserGRBL #1086, LumaViewPro #205). 8: a retry starts two runs, and a false
idle (GEECS #905, bluesky-queueserver #326). 9: the page shows the past (strand-braid #20, thingino #1595).
``ELSEWHERE`` says where the others are tried.
"""

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI
from nicegui import app as pages
from playwright.sync_api import Browser, Page, expect

from daq.files.run_directory import RunReader
from server.lab.services import Services
from server.rig.config import load_config
from server.rig.far_end_host import FarEndHost, host_far_ends
from server.web.app import create_app
from tests.support.server_process import ENVIRONMENT, ServerProcess
from tests.support.serving import Serving, serving
from tests.support.simulated_serving import CURRENT_A, BenchServing, serving_bench, tiny_config
from tests.support.soak_kill import write_rig

ROOT = Path(__file__).parents[2]
LIMIT_S = 120.0
PLAN = {"name": "bug", "kind": "background", "shots": 1, "rate_hz": 20.0, "pulse": {"current_a": CURRENT_A}}
ELSEWHERE = {
    "old images pass as a finished run (GEECS #861)": "system/test_camera_returns.py::test_old_images_never_pass",
    "off by one for the rest (campy #24)": "system/test_pairing.py::test_only_the_shots_that_a_fault_hits",
    "a late frame is the next shot's (harvesters #383)": "system/test_pairing.py::test_only_the_shots_that_a_fault",
    "stop throws away what was recorded (ADCore #469)": "daq/run/test_slow_disk.py::test_what_waits_for_the_disk",
    "disk filled, permission lost (pymalcolm #323)": "daq/run/test_storage_faults.py::test_light_goes_off_first",
    "a second cause is hidden (phoebus #1928)": "system/test_second_cause.py::test_a_generator_that_restarts",
    "a camera with factory settings (areaDetector #36)": "system/test_camera_returns.py::test_a_camera_with_factory",
    "another geometry, old calibration (PIVlab)": "server/lab/starting/test_run_start.py::test_a_calibration_of",
}


@pytest.mark.parametrize("bug", ELSEWHERE)
def test_the_other_bugs_are_tried_where_it_says(bug: str) -> None:
    path, name = ELSEWHERE[bug].split("::")
    assert f"\ndef {name}" in (ROOT / "tests" / path).read_text(encoding="utf-8")


def eventually(is_so: Callable[[], bool], what: str) -> None:
    end_s = time.monotonic() + LIMIT_S
    while not is_so():
        assert time.monotonic() < end_s, f"waited {LIMIT_S:g} s until {what}"
        time.sleep(0.05)


@pytest.fixture
def rig_file(tmp_path: Path) -> Path:
    path = write_rig(tmp_path)
    path.write_text(path.read_text().replace("led_channel = 1\n", "led_channel = 1\nmax_light_a = 0.2\n"))
    return path


@pytest.fixture
def far_ends(rig_file: Path) -> Iterator[FarEndHost]:
    """The far ends of the rig, which outlive who works with them."""
    with host_far_ends(load_config(rig_file)) as host:
        yield host


@pytest.mark.network
@pytest.mark.parametrize("blow", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "hangs"])
def test_6_light_ends_with_its_program(far_ends: FarEndHost, rig_file: Path, blow: signal.Signals) -> None:
    generator = far_ends._ends.devices.generator
    command = [sys.executable, "-m", "server.cli", "firmware", "light", "--config", str(rig_file), "--current-a", "0.1"]
    with subprocess.Popen(command, env=ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as program:
        eventually(lambda: bool(generator.light_a), "there is light")
        program.send_signal(blow)
        eventually(lambda: not generator.light_a, "it is dark without the program, which still holds the port")
        program.kill()


@pytest.mark.network
@pytest.mark.slow
def test_6_a_recording_server_that_hangs_or_dies_leaves_darkness_and_a_named_fault(
    far_ends: FarEndHost, rig_file: Path
) -> None:
    fired: list[int] = []
    far_ends._ends.laboratory.witnesses.append(lambda train: fired.append(train.sequence))
    current_a = {name: view.nominal_current_a for name, view in load_config(rig_file).views.items()}
    plan = {**PLAN, "shots": 1000, "rate_hz": 10.0, "pulse": {"current_a": current_a}}
    with ExitStack() as servers:
        first = ServerProcess(rig_file.parent, rig_file)
        servers.callback(first.http.close)
        servers.callback(first.kill)
        eventually(first.answers, "the server answers")
        assert first.http.post("/api/runs", json=plan).status_code == 201
        eventually(lambda: bool(fired), "there is a shot")
        os.kill(first.pid, signal.SIGSTOP)
        time.sleep(0.5)  # what was on its way
        before = len(fired)
        time.sleep(3.5)  # the generator gives its computer up after 3 s
        os.kill(first.pid, signal.SIGCONT)
        eventually(lambda: acquisition(first)["outcome"] == "failed", "the run has failed")
        causes = first.http.get(f"/api/runs/{acquisition(first)['run_id']}").json()["causes"]
        assert any("heartbeat" in cause["text"] for cause in causes), causes
        assert len(fired) == before
        eventually(lambda: first.http.post("/api/rig/acknowledge").is_success, "the fault is acknowledged")
        while acquisition(first)["to_acknowledge"]:  # the cameras may have given up the hung server too
            assert first.http.post("/api/rig/acknowledge").is_success
        eventually(lambda: first.http.post("/api/runs", json=plan).status_code == 201, "the next run is accepted")
        eventually(lambda: len(fired) > before, "there are shots again")
        first.kill()
        after = len(fired)
        time.sleep(3.5)  # a server that comes back within the heartbeat would find no fault
        second = ServerProcess(rig_file.parent, rig_file)
        servers.callback(second.http.close)
        servers.callback(second.kill)
        eventually(second.answers, "the next server answers")
        refused = second.http.post("/api/runs", json=plan)
        assert (refused.status_code, "acknowledge" in refused.text) == (503, True), refused.text
        (lamp,) = (lamp for lamp in second.http.get("/api/rig").json()["lamps"] if lamp["kind"] == "generator")
        assert (lamp["health"], lamp["detail"]) == ("fault", "fault, heartbeat")
        assert len(fired) <= after + 1, "it fires nothing that nobody has asked for"


def acquisition(server: ServerProcess) -> dict[str, Any]:
    state: dict[str, Any] = server.http.get("/api/rig").json()["acquisition"]
    return state


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BenchServing]:
    with serving_bench(tiny_config(tmp_path_factory.mktemp("bugs") / "runs", subnet=11)) as served:
        yield served


def runs_of(bench: BenchServing) -> set[str]:
    return {path.parent.name for path in bench.data_dir.glob("*/run.h5")}


@pytest.mark.network
def test_8_of_two_starts_at_once_one_is_a_run_and_one_is_refused(bench: BenchServing) -> None:
    known = runs_of(bench)
    with ThreadPoolExecutor(2) as clerks:
        for _ in range(10):
            answers = list(clerks.map(lambda _: bench.http.post("/api/runs", json=PLAN), range(2)))
            started, refused = sorted(answers, key=lambda answer: answer.status_code)
            assert (started.status_code, refused.status_code) == (201, 409)
            new = runs_of(bench) - known
            assert {started.headers["location"]} == {f"/api/runs/{run_id}" for run_id in new}
            assert re.search(rf"being started|{new.pop()}", refused.json()["detail"])
            bench.end()
            known = runs_of(bench)


def until_answered(bench: BenchServing, key: dict[str, str]) -> httpx.Response:
    """Ask again, as a script does, while the first request is still being worked on."""
    answers: list[httpx.Response] = []

    def is_over() -> bool:
        answers.append(bench.http.post("/api/runs", json=PLAN, headers=key))
        return bool(answers[-1].json().get("code") != "in_progress")

    eventually(is_over, "the first request is answered")
    return answers[-1]


@pytest.mark.network
def test_8_a_retry_after_a_cut_connection_names_the_run_that_was_started(bench: BenchServing) -> None:
    known, key = runs_of(bench), {"Idempotency-Key": "after lunch"}
    request = httpx.Request("POST", bench.http.base_url.join("/api/runs"), json=PLAN, headers=key)
    head = "".join(f"{name}: {value}\r\n" for name, value in request.headers.items())
    with socket.create_connection((request.url.host, request.url.port), LIMIT_S) as connection:
        connection.sendall(f"POST /api/runs HTTP/1.1\r\n{head}\r\n".encode() + request.content)
    eventually(lambda: bool(runs_of(bench) - known), "the request whose answer nobody reads has started a run")
    (run_id,) = runs_of(bench) - known
    for _ in range(2):
        answer = until_answered(bench, key)
        assert (answer.status_code, answer.headers["location"]) == (201, f"/api/runs/{run_id}")
    assert bench.http.post("/api/runs", json=PLAN | {"shots": 2}, headers=key).status_code == 422
    bench.end()
    assert runs_of(bench) - known == {run_id}


@pytest.mark.network
def test_8_the_rig_is_never_idle_before_the_run_has_its_outcome(bench: BenchServing) -> None:
    told: list[dict[str, Any]] = []
    over = threading.Event()

    def look() -> None:
        with httpx.Client(base_url=bench.http.base_url) as other:
            while not over.wait(0.01):
                told.append(other.get("/api/rig").json()["acquisition"])
                if told[-1]["state"] == "idle" and told[-1]["run_id"]:
                    told[-1]["on disk"] = RunReader(bench.data_dir / told[-1]["run_id"]).outcome

    with ThreadPoolExecutor(1) as clerk:
        looking = clerk.submit(look)
        try:
            run_id = bench.start(1, kind="calibration", stage_z_mm=[-1.0, 0.0, 1.0])
            assert bench.end().outcome == "completed"
        finally:
            over.set()
        looking.result(LIMIT_S)
    of_run = [one for one in told if one["run_id"] == run_id]
    assert "acquiring" in {one["state"] for one in of_run}
    states = [one["state"] for one in of_run]
    assert "idle" not in states[: max(n for n, state in enumerate(states) if state != "idle")]
    assert {one["on disk"] for one in of_run if one["state"] == "idle"} <= {"completed"}


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Serving, Callable[[], int]]]:
    """The page of a rig that is shown live, and how many tabs look at it."""
    apps: list[FastAPI] = []
    pages.middleware_stack = None  # NiceGUI has one application per process; another module may have used it

    def build(services: Services) -> FastAPI:
        apps.append(create_app(services))
        return apps[0]

    with serving(tmp_path_factory.mktemp("page") / "runs", build=build) as server:
        live = {"rate_hz": 10, "pulse": {"current_a": dict.fromkeys(server.services.config.views, 5)}}
        assert server.http.put("/api/rig/live", json=live).is_success
        yield server, lambda: len(apps[0].state.context.live._readers)


def shot_shown(page: Page) -> int:
    caption = page.get_by_role("status", name="view1 newest shot")
    expect(caption).to_have_text(re.compile(r"shot \d+ "), timeout=LIMIT_S * 1000)
    return int(re.findall(r"shot (\d+)", caption.text_content() or "")[0])


def await_newest(page: Page, server: Serving) -> None:
    """The page goes on, and shows what is newer than what there was when this was asked."""
    newest = server.services.acquisition.newest_shot
    assert newest is not None
    eventually(lambda: shot_shown(page) > newest.index, f"the page shows more than shot {newest.index}")


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_9_a_page_that_slept_or_was_offline_shows_the_present_and_keeps_its_form(
    browser: Browser, shown: tuple[Serving, Callable[[], int]]
) -> None:
    server, readers = shown
    with closing(browser.new_context()) as context:
        page = context.new_page()
        page.goto(str(server.http.base_url))
        page.get_by_label("Name", exact=True).fill("kept")
        await_newest(page, server)
        devtools = context.new_cdp_session(page)
        devtools.send("Page.setWebLifecycleState", {"state": "frozen"})
        time.sleep(2.0)
        devtools.send("Page.setWebLifecycleState", {"state": "active"})
        await_newest(page, server)
        context.set_offline(True)
        time.sleep(2.0)
        context.set_offline(False)
        await_newest(page, server)
        for _ in range(4):
            page.reload()
        await_newest(page, server)
        expect(page.get_by_label("Name", exact=True)).to_have_value("kept")
        eventually(lambda: readers() == 1, "one tab has one socket")
        others = [context.new_page() for _ in range(3)]
        for other in others:
            other.goto(str(server.http.base_url))
        eventually(lambda: readers() == 4, "four tabs have four sockets")
        await_newest(others[-1], server)
    eventually(lambda: readers() == 0, "no tab has no socket")
