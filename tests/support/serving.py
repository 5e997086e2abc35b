"""The application on a real socket of the loopback interface, in a thread of the test."""

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import uvicorn
from fastapi import FastAPI

from daq.run.acquisition import Acquisition
from daq.run.events import RunStatus
from processing.calibration.calibration_file import file_sha256
from processing.volume import VoxelGrid
from server.lab.calibrations import CalibrationStore
from server.lab.engine.inline_engine import InlineEngine
from server.lab.engine.task import Engine
from server.lab.events import EventPublisher
from server.lab.jobs.job import JobKind
from server.lab.services import Services
from server.pictures.previews import make_preview, preview_path, save_preview
from server.web.abort_listener import AbortListener
from server.web.app import create_api
from server.web.connections import config_of
from server.web.ending_server import EndingServer
from tests.support.memory_rig import VIEWS, memory_config, served_rig

DEADLINE_S = 60.0
ASKED_EVERY_S = 0.2
"""Devices are asked more often than is of use to people: tests wait for what is found."""


@dataclass(frozen=True)
class Serving:
    """A running application and what surrounds it."""

    http: httpx.Client
    port: int
    services: Services
    app: FastAPI

    @property
    def abort_listener(self) -> AbortListener:
        """The second door, for ABORT alone."""
        listener: AbortListener = self.app.state.abort_listener
        return listener

    def run_to_its_end(self, plan: dict[str, Any]) -> tuple[str, RunStatus]:
        """Start a run and wait for it; its id and last status."""
        answer = self.http.post("/api/runs", json=plan)
        assert answer.status_code == 201, answer.text
        status = self.wait()
        return answer.headers["location"].rsplit("/", 1)[-1], status

    def free_control(self) -> None:
        """Nobody holds control any more."""
        control = self.app.state.context.control
        if holder := control.holder:
            control.release(holder.who)

    def wait(self) -> RunStatus:
        """Status once no run is active."""
        acquisition = self.services.acquisition
        assert isinstance(acquisition, Acquisition)
        return acquisition.wait(DEADLINE_S)


def plan_of(**changes: Any) -> dict[str, Any]:
    """A plan that the rig in memory can run."""
    plan = {
        "name": "test",
        "kind": "sample",
        "shots": 2,
        "rate_hz": 20.0,
        "pulse": {"current_a": dict.fromkeys(VIEWS, 5)},
    }
    return plan | changes


def write_spray(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    """Work function: a shell of droplets on a small grid, without looking at any image."""
    results_dir = Path(job["results_dir"])
    results_dir.mkdir(parents=True, exist_ok=True)
    grid = VoxelGrid.centred((40, 60, 50), 0.2)
    z, y, x = np.meshgrid(grid.z_mm, grid.y_mm, grid.x_mm, indexing="ij")
    radius = np.hypot(x, z)
    volume = np.exp(-((radius - 0.35 * (y + 6)) ** 2) / 0.3) * (0.6 + 0.4 * np.sin(9 * np.arctan2(z, x) + 2 * y))
    file = Path(job["calibration_file"])
    calibration = {"calibration": json.loads(file.read_text())["id"], "calibration_file": file.name}
    record = {"run": Path(job["run_dir"]).name, **calibration, "settings": json.dumps(job["settings"])}
    (results_dir / "settings.json").write_text(json.dumps(record))
    files = []
    for frame in "ab":
        if should_stop():
            return {}
        path = results_dir / f"shot_{job['shot']:05d}_{frame}.vtkhdf"
        path.write_bytes(b"volume")
        save_preview(preview_path(path), make_preview(volume.astype(np.float32), grid), {**record, "shot": job["shot"]})
        files.append({"shot": job["shot"], "frame": frame, "file": path.name, "seconds": 0.1})
    return {"shot": job["shot"], "volumes": files}


def write_calibration(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    """Work function: a calibration file with nothing in it."""
    Path(job["calibration_file"]).write_text(json.dumps({"id": "made", "model": job["settings"]["model"]}))
    return {"calibration": "made"}


def tell_nothing(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    """Work function: a check of a shot without droplets."""
    nothing: dict[str, Any] = {"verdict": None, "moved": None, "views": {}, "uncertainty_px": {}}
    return {"shot": job["shot"], **nothing, "problem": "too few droplets"}


@contextmanager
def assembled(
    data_dir: Path,
    *,
    engine: Engine | None = None,
    views: tuple[str, ...] = VIEWS,
    token: str | None = None,
    viewer_token: str | None = None,
) -> Iterator[Services]:
    """A rig in memory with its acquisition, ready to be served."""
    laboratory, events = served_rig(views), EventPublisher()
    rig = replace(laboratory.rig, stage=None)
    calibrations = CalibrationStore(data_dir / "calibrations")

    def hashed(name: str) -> str:
        return file_sha256(calibrations.path(name))

    with Acquisition(rig, data_dir, events.publish_run_event, hash_calibration=hashed) as acquisition:
        yield Services(
            config=memory_config(data_dir, views, token, viewer_token),
            rig=rig,
            acquisition=acquisition,
            events=events,
            engine=engine or InlineEngine(),
            tasks={
                JobKind.RECONSTRUCTION: write_spray,
                JobKind.CALIBRATION: write_calibration,
                JobKind.CHECK: tell_nothing,
            },
            laboratory=laboratory,
            asked_every_s=ASKED_EVERY_S,
        )


@contextmanager
def serving(
    data_dir: Path,
    *,
    build: Callable[[Services], FastAPI] = create_api,
    engine: Engine | None = None,
    views: tuple[str, ...] = VIEWS,
    token: str | None = None,
    viewer_token: str | None = None,
) -> Iterator[Serving]:
    """Serve a rig in memory until the block ends."""
    with assembled(data_dir, engine=engine, views=views, token=token, viewer_token=viewer_token) as services:
        app = build(services)
        with (
            listening(app) as port,
            httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=DEADLINE_S) as http,
        ):
            yield Serving(http, port, services, app)


@contextmanager
def listening(app: FastAPI) -> Iterator[int]:
    """Serve an application at a free port of the loopback interface."""
    started = threading.Event()
    server = _Server(config_of(app, port=0, log_level="error", timeout_graceful_shutdown=1), started)
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        assert started.wait(DEADLINE_S)
        yield server.servers[0].sockets[0].getsockname()[1]
    finally:
        server.end()
        if door := getattr(getattr(app, "state", None), "abort_listener", None):
            door.end()  # it takes as long as the other one to end, and so they end together
        thread.join(DEADLINE_S)
        assert not thread.is_alive(), "the server has not ended"


class _Server(EndingServer):
    """Says when it listens."""

    def __init__(self, config: uvicorn.Config, started: threading.Event) -> None:
        super().__init__(config)
        self._listens = started

    async def startup(self, *arguments: Any, **named: Any) -> None:
        await super().startup(*arguments, **named)
        self._listens.set()
