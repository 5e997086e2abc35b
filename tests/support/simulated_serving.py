"""The application with a small simulated bench behind it: two views of 80 x 60 pixels, real drivers."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx

from daq.devices import Rig
from daq.faults import ScriptedFault
from daq.files.run_directory import RunReader
from daq.run.acquisition import Acquisition
from daq.run.events import RunStatus
from daq.run.limits import AcquisitionLimits
from daq.run.state import RunOutcome
from daq.run_plan import RunPlan
from daq.simulation.laboratory import SimulatedLaboratory
from server.lab.engine.inline_engine import InlineEngine
from server.lab.events import EventPublisher
from server.lab.services import Services
from server.rig.assembly import open_rig
from server.rig.config import RigConfig, load_config
from server.web.app import create_api
from tests.support.serving import ASKED_EVERY_S, DEADLINE_S, listening

VIEWS = ("view1", "view2")
CURRENT_A = {"view1": 25.0, "view2": 9.9}
SMALL = Path("configs/simulated_small.toml")


def tiny_config(data_dir: Path, *faults: ScriptedFault, subnet: int = 6) -> RigConfig:
    """The small simulated rig with two views of few pixels, at addresses of its own."""
    config = load_config(SMALL)
    views = {}
    for number, name in enumerate(VIEWS, 1):
        view = config.views[name]
        sensor = view.sensor.model_copy(update={"width_px": 80, "height_px": 60, "pixel_pitch_um": 148.0})
        camera = view.camera.model_copy(update={"ip": f"127.0.{subnet}.{number}"})
        views[name] = view.model_copy(update={"sensor": sensor, "camera": camera})
    assert config.simulation is not None
    simulation = config.simulation.model_copy(update={"faults": faults})
    server = config.server.model_copy(update={"data_dir": data_dir})
    return config.model_copy(update={"views": views, "simulation": simulation, "server": server})


@dataclass(frozen=True)
class BenchServing:
    """A running application, asked by HTTP as everybody else does."""

    http: httpx.Client
    rig: Rig
    laboratory: SimulatedLaboratory
    acquisition: Acquisition
    data_dir: Path

    def inject(self, kind: str, **fields: Any) -> None:
        """Let something go wrong on the bench."""
        answer = self.http.post("/api/bench/faults", json={"kind": kind, **fields})
        assert answer.status_code == 202, answer.text

    @contextmanager
    def during(self, kind: str, **fields: Any) -> Iterator[None]:
        """A fault that lasts as long as the block."""
        self.inject(kind, **fields)
        try:
            yield
        finally:
            self.inject(kind, **fields, duration_s=0)

    def lamp(self, name: str) -> dict[str, Any]:
        """One lamp."""
        lamps: list[dict[str, Any]] = self.http.get("/api/rig").json()["lamps"]
        return {lamp["name"]: lamp for lamp in lamps}[name]

    def await_lamp(self, name: str, health: str) -> dict[str, Any]:
        """Wait until a lamp has this colour."""
        eventually(lambda: self.lamp(name)["health"] == health, lambda: f"{self.lamp(name)} is not {health}")
        return self.lamp(name)

    def start(self, shots: int = 2, **changes: Any) -> str:
        """Start a background run, whatever its lamps say: a camera may come back, or be lost, at any moment; its id."""
        pulse = {"current_a": CURRENT_A}
        plan = {"name": "test", "kind": "background", "shots": shots, "rate_hz": 10.0, "pulse": pulse}
        return self.acquisition.start(RunPlan.model_validate({**plan, **changes}))

    def run(self, shots: int = 2, **changes: Any) -> RunStatus:
        """A background run from start to end."""
        self.start(shots, **changes)
        return self.end()

    def end(self) -> RunStatus:
        """Wait for the end of the active run."""
        status = self.acquisition.wait(DEADLINE_S)
        assert not status.active
        return status

    def reader(self) -> RunReader:
        """The last run on the disk."""
        return RunReader(self.data_dir / str(self.acquisition.status().run_id))

    def await_shots(self, recorded: int) -> None:
        """Wait until so many shots of the active run are on the disk."""
        status = self.acquisition.status
        eventually(lambda: status().shots_recorded >= recorded or not status().active, status)
        assert status().active, status().message

    def assert_next_run_is_sound(self) -> None:
        """A run as if nothing had been."""
        status = self.run(2)
        assert (status.outcome, status.shots_valid) == (RunOutcome.COMPLETED, 2), status.message
        reader = self.reader()
        assert (reader.outcome, reader.cause) == ("completed", "")
        assert all(reader.read_shot(index).valid for index in range(2))


def eventually(condition: Callable[[], bool], otherwise: Callable[[], object]) -> None:
    """Wait for a condition, as long as a busy machine may take."""
    deadline_s = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline_s, otherwise()
        threading.Event().wait(0.1)


LIMITS = AcquisitionLimits(frame_s=2.0)


def _as_it_is(rig: Rig) -> Rig:
    return rig


@contextmanager
def serving_bench(
    config: RigConfig, limits: AcquisitionLimits = LIMITS, watch: Callable[[Rig], Rig] = _as_it_is
) -> Iterator[BenchServing]:
    """Serve a simulated bench until the block ends; who watches its devices stands between them and all others."""
    events, data_dir = EventPublisher(), config.server.data_dir
    with (
        open_rig(config) as assembled,
        Acquisition(
            rig := watch(assembled.rig),
            data_dir,
            events.publish_run_event,
            limits=limits,
            observers=assembled.observers,
        ) as acquisition,
        listening(
            create_api(
                Services(
                    config,
                    rig,
                    acquisition,
                    events,
                    InlineEngine(),
                    {},
                    laboratory=assembled.laboratory,
                    asked_every_s=2 * ASKED_EVERY_S,
                )
            )
        ) as port,
        httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=DEADLINE_S) as http,
    ):
        assert isinstance(assembled.laboratory, SimulatedLaboratory)
        yield BenchServing(http, rig, assembled.laboratory, acquisition, data_dir)
