"""What a whole server does in its own process: starts beside many runs, and makes volumes of what it records."""

import json
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime, timedelta
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np

from daq.counted import counted
from daq.files.run_directory import (
    DoubleFrame,
    ExposureRecord,
    ImageKey,
    RunHeader,
    RunReader,
    RunWriter,
    Shot,
    ViewFormat,
)
from daq.run.state import RunState
from processing.benchmarks import targets
from processing.benchmarks.targets import Measured
from processing.calibration.calibration_file import save_calibration
from processing.studies.seen_droplets import droplet_calibration
from processing.synthetic.truth_file import read_true_cameras
from server.cli.benchmarks.bench_rig import NoRig, rig_in
from server.rig.config import load_config
from server.rig.simulated_operator import TRUTH_FILE
from server.web.port import listening

RUNS = 10_000
LIMIT_S, STEP_S = 600.0, 0.02
TRIGGERED_SHOTS, RATE_HZ = 5, 0.2
HALF_MM = np.array([5.0, 5.0, 4.5])
"""Of the volume that is reconstructed."""


class Server:
    """``tomoshadow serve`` in a process of its own, asked by HTTP."""

    def __init__(self, config: Path, port: int, module: str) -> None:
        command = [sys.executable, "-m", module, "serve", "--config", str(config), "--port", str(port)]
        self.begun_s = time.perf_counter()
        self.page_url = f"http://127.0.0.1:{port}"
        self._url = f"{self.page_url}/api"
        self.live_address = f"ws://127.0.0.1:{port}/api/live"
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def ask(self, path: str, body: Any = None, method: str | None = None) -> Any:
        """Send JSON, if there is any, and get what the server answers."""
        return json.loads(self.get(path, body, method) or "null")

    def get(self, path: str, body: Any = None, method: str | None = None) -> bytes:
        """The same for what is no JSON."""
        data = None if body is None else json.dumps(body).encode()
        request = Request(f"{self._url}/{path}", data, {"Content-Type": "application/json"}, method=method)  # noqa: S310
        try:
            with urlopen(request, timeout=LIMIT_S) as answer:  # noqa: S310 - of this machine
                return bytes(answer.read())
        except HTTPError as error:
            raise NoRig(f"{path}: {error.read().decode()}") from error

    def up(self) -> bool:
        """Whether it answers."""
        if self.process.poll() is not None:
            raise NoRig(f"the server ended with {self.process.returncode}")
        try:
            return bool(self.ask("rig"))
        except OSError:  # refused, or too busy to answer
            return False


@contextmanager
def served(config: Path, module: str = "server.cli") -> Iterator[Server]:
    """A server, of a module that has its commands, that has just answered for the first time; ended with the block."""
    with listening("127.0.0.1", 0) as free:
        port = free.getsockname()[1]
    server = Server(config, port, module)
    try:
        _until(server.up, "the server answers")
        yield server
    finally:
        server.process.terminate()
        server.process.wait(LIMIT_S)


def server_start(directory: Path | None, runs: int = RUNS) -> Iterator[Measured]:
    """Start beside so many runs, and list the newest; the first start reads them all."""
    with TemporaryDirectory(dir=directory) as folder:
        config = rig_in(Path(folder))
        _write_runs(Path(folder) / "runs", runs)
        listed_s = []
        for _ in range(2):
            with served(config) as server:
                up_s = time.perf_counter() - server.begun_s
                server.ask("runs")
                listed_s.append(time.perf_counter() - server.begun_s)
        listed = f"listed after {listed_s[1]:.2g} s, without an index after {listed_s[0]:.2g} s"
        how = f"{counted(runs, 'run')}; they are {listed}"
        yield Measured(targets.START, up_s, how=how)


def trigger_to_volume(directory: Path | None, shots: int = TRIGGERED_SHOTS) -> Iterator[Measured]:
    """Record one shot after the other, and wait for what is made of it; the first one warms up.

    All show the same: to render a shot takes the simulated cameras 1.5 CPU-s after its trigger, which real ones do not.
    """
    with TemporaryDirectory(dir=directory) as folder:
        config, data_dir = rig_in(Path(folder), still=True), Path(folder) / "runs"
        with served(config) as server:
            calibration = calibrated(server, config, data_dir)
            run_id = _recorded(server, config, shots, calibration)
            _until(lambda: len(_done(server, run_id)) == shots, "all volumes are made")
            done = _done(server, run_id)
        with RunReader(data_dir / run_id) as run:
            waits_s = [done[shot] - run.read_shot(shot).host_time_ns / 1e9 for shot in range(shots)]
    yield Measured(
        targets.TRIGGER,
        median(waits_s[1:]),
        how=f"median of {shots - 1}, the first {waits_s[0]:.2g} s; rendered before",
    )


def calibrated(server: Server, config: Path, data_dir: Path) -> str:
    """Record one shot, and keep the cameras that really took it as a calibration; its name."""
    warm = _recorded(server, config, 1, None)
    cameras = read_true_cameras(data_dir / warm / TRUTH_FILE)
    save_calibration(droplet_calibration(list(cameras.values()), HALF_MM), data_dir / "calibrations" / "true.json")
    return "true"


def _done(server: Server, run_id: str) -> dict[int, float]:
    """When the volumes of each shot were there, seconds since 1970."""
    jobs = [job for job in server.ask("jobs") if job["run_id"] == run_id and job["kind"] == "reconstruction"]
    if failed := [job["error"] for job in jobs if job["state"] == "failed"]:
        raise NoRig(f"no volume: {failed[0]}")
    return {
        job["shot"]: datetime.fromisoformat(job["changed_utc"]).timestamp() for job in jobs if job["state"] == "done"
    }


def start(server: Server, config: Path, shots: int, calibration: str | None, rate_hz: float = RATE_HZ) -> None:
    """Begin a run of a spray."""
    current_a = {name: view.nominal_current_a for name, view in load_config(config).views.items()}
    plan = {"name": "bench", "kind": "sample", "shots": shots, "rate_hz": rate_hz, "pulse": {"current_a": current_a}}
    server.ask("runs", plan | {"calibration": calibration}, "POST")


def _recorded(server: Server, config: Path, shots: int, calibration: str | None) -> str:
    start(server, config, shots, calibration)
    _until(lambda: server.ask("rig")["acquisition"]["state"] == RunState.IDLE, "the run has ended")
    return str(server.ask("runs")[0]["run_id"])


def _write_runs(data_dir: Path, runs: int) -> None:
    """As many copies of one small run, a minute after each other."""
    seen, frame = ExposureRecord(True, 1), np.zeros((6, 8), np.uint8)
    header = RunHeader(
        run_id="20260101T000000-bench", created_utc="2026-01-01T00:00:00+00:00", views={"view1": ViewFormat((6, 8), 8)}
    )
    first = data_dir / header.run_id
    with RunWriter(first, header) as writer:
        writer.write_shot(Shot(0, ImageKey.SAMPLE, {"view1": DoubleFrame(frame, frame, seen, seen)}))
        writer.finish("completed")
    for number in range(1, runs):
        shutil.copytree(first, data_dir / f"{datetime(2026, 1, 1) + timedelta(minutes=number):%Y%m%dT%H%M%S}-bench")


def _until(is_so: Callable[[], bool], what: str) -> None:
    end_s = time.monotonic() + LIMIT_S
    while not is_so():
        if time.monotonic() > end_s:
            raise NoRig(f"waited {LIMIT_S:g} s until {what}")
        time.sleep(STEP_S)
