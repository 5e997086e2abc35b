"""The whole system as an operator meets it: ``tomoshadow serve`` on the simulated bench, driven from a browser."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import Browser

from tests.support.desk import opened_tab
from tests.support.operator import VIEWS, drive_the_page
from tests.support.server_process import free_port

pytestmark = [pytest.mark.network, pytest.mark.timeout(900)]

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "configs" / "simulated_small.toml"
CURRENT_A = {"view1": 25.0, "view2": 9.9, "view3": 10.0, "view4": 26.0}
DEADLINE_S = 180.0
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}


def command(port: int) -> list[str]:
    return [sys.executable, "-m", "server.cli", "serve", "--config", str(CONFIG), "--port", str(port)]


@contextmanager
def served(work_dir: Path) -> Iterator[tuple[httpx.Client, subprocess.Popen[bytes]]]:
    """A server process of its own, and a client of it."""
    port = free_port()
    with (
        subprocess.Popen(command(port), cwd=work_dir, env=ENVIRONMENT) as process,
        httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=DEADLINE_S) as client,
    ):
        try:
            eventually(lambda: _answers(client), "the server answers")
            yield client, process
        finally:
            process.terminate()


def eventually(is_so: Callable[[], bool], what: str) -> None:
    end_s = time.monotonic() + DEADLINE_S
    while not is_so():
        assert time.monotonic() < end_s, f"waited {DEADLINE_S} s until {what}"
        time.sleep(0.1)


def _answers(client: httpx.Client) -> bool:
    try:
        return client.get("/api/rig").status_code == 200
    except httpx.TransportError:
        return False


def record(client: httpx.Client, kind: str, shots: int, **details: Any) -> str:
    """Record a run to its end; its id."""
    plan = {"name": kind, "kind": kind, "shots": shots, "rate_hz": 4, "pulse": {"current_a": CURRENT_A}, **details}
    answer = client.post("/api/runs", json=plan)
    assert answer.status_code == 201, answer.text
    run_url = answer.headers["location"]
    eventually(lambda: client.get(run_url).json()["outcome"] != "active", f"run {kind} ends")
    assert client.get(run_url).json()["outcome"] == "completed"
    return str(run_url.rsplit("/", 1)[-1])


def calibrate(client: httpx.Client, run_id: str) -> None:
    """Calibrate from a run, and choose the result for coming runs."""
    job_url = client.post("/api/calibrations", json={"run_id": run_id}).headers["location"]
    eventually(lambda: client.get(job_url).json()["state"] in ("done", "failed"), "the calibration is fitted")
    assert client.get(job_url).json()["state"] == "done", client.get(job_url).text
    calibrations = client.get("/api/calibrations").json()
    assert client.put("/api/calibrations/current", json={"id": calibrations[0]["id"]}).status_code == 200


def test_from_target_to_volume_in_a_browser(tmp_path: Path, browser: Browser) -> None:
    with served(tmp_path) as (client, process), opened_tab(browser) as page:
        target_run = record(client, "calibration", 1, stage_z_mm=[-4.5, -2.5, -0.5, 1.5, 4.5])
        calibrate(client, target_run)
        record(client, "dark", 2)
        record(client, "background", 2)
        drive_the_page(page, str(client.base_url), VIEWS, shots=2)
        page.goto("about:blank")
        runs = client.get("/api/runs").json()
        sample = next(run for run in runs if run["kind"] == "sample")
        eventually(lambda: len(client.get(f"/api/runs/{sample['run_id']}/results").json()) > 0, "there are results")
        assert (tmp_path / "runs" / sample["run_id"] / "truth" / "truth.h5").is_file()
        process.send_signal(signal.SIGTERM)
        assert process.wait(DEADLINE_S) == 0


def refused(port: int, work_dir: Path) -> str:
    """What a server says that does not start."""
    work_dir.mkdir(exist_ok=True)
    late = subprocess.run(
        command(port), cwd=work_dir, env=ENVIRONMENT, capture_output=True, text=True, timeout=DEADLINE_S, check=False
    )
    assert late.returncode in (1, 2), f"a second server ended with {late.returncode}: {late.stderr}"
    assert "Traceback" not in late.stderr
    return late.stderr


def test_a_second_server_is_refused_and_leaves_the_run_of_the_first_one_alone(tmp_path: Path) -> None:
    torn = "20200101T000000-torn"
    (tmp_path / "runs" / torn).mkdir(parents=True)
    with served(tmp_path) as (client, process):
        assert (tmp_path / "runs" / "set-aside" / torn).is_dir(), "a start looks after what a crash has left"
        plan = {"name": "long", "kind": "dark", "shots": 600, "rate_hz": 1, "pulse": {"current_a": CURRENT_A}}
        run_url = client.post("/api/runs", json=plan).headers["location"]
        eventually(lambda: client.get(run_url).json()["shots_recorded"] > 0, "there is a shot")
        assert client.get(run_url).json()["outcome"] == "active"
        assert "cannot listen there" in refused(int(client.base_url.port or 0), tmp_path / "port")
        holder = f"is held by process {process.pid}, since "
        assert f"data directory runs {holder}" in refused(free_port(), tmp_path)
        port = free_port()
        late = refused(port, tmp_path / "elsewhere")
        assert holder in late
        assert f"http://127.0.0.1:{port}, and ABORT alone at port " in late, (
            "whoever starts a server is told where the page is"
        )
        shots = client.get(run_url).json()["shots_recorded"]
        eventually(lambda: client.get(run_url).json()["shots_recorded"] > shots, "the run goes on")
        assert client.get(run_url).json()["outcome"] == "active"
        client.post(f"{run_url}/stop")
        eventually(lambda: client.get(run_url).json()["outcome"] != "active", "the run stops")
        run = client.get(run_url).json()
        assert (run["outcome"], run["shots_valid"]) == ("stopped", run["shots_recorded"])
