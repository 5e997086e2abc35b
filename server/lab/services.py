"""Services: everything the web application is given, and everything it builds from that at start-up."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from daq.causes import Cause
from daq.devices import Rig
from daq.errors import DaqError
from daq.run.events import RunStatus
from daq.run_plan import LivePlan, RunPlan
from daq.shot import Shot
from processing.reconstruction.settings import ReconstructionSettings
from processing.runs.volumes.volume_parts import VolumeParts
from server.lab.calibrations import CalibrationStore
from server.lab.desk.beat import Beat
from server.lab.desk.control import Control
from server.lab.desk.desk_watch import DeskWatch
from server.lab.desk.once import Once
from server.lab.duty import Duty, Lamp
from server.lab.engine.task import Engine, Task
from server.lab.events import EventPublisher
from server.lab.jobs.job import JobKind
from server.lab.jobs.job_table import JobTable
from server.lab.live_view.live_feed import LiveFeed
from server.lab.live_view.live_volume import LiveVolume
from server.lab.monitor import PERIOD_S, RigMonitor
from server.lab.runner import JobRunner
from server.lab.runs.run_store import RunStore
from server.lab.runs.unkept_runs import UnkeptRuns
from server.lab.watch import CalibrationStanding, CalibrationWatch
from server.rig.config import RigConfig
from server.rig.laboratory import Laboratory


class RunControl(Protocol):
    """What the server asks of ``daq.run.acquisition.Acquisition``; only what starts something takes its time."""

    def refusals(self, plan: RunPlan | None = None) -> Iterator[DaqError]: ...  # noqa: D102
    def start(self, plan: RunPlan) -> str: ...  # noqa: D102
    def start_live(self, plan: LivePlan) -> None: ...  # noqa: D102
    def keep_live(self) -> None: ...  # noqa: D102
    def end_live(self) -> None: ...  # noqa: D102
    def stop(self) -> None: ...  # noqa: D102
    def abort(self) -> None: ...  # noqa: D102
    def acknowledge(self, cause: Cause | None = None) -> None: ...  # noqa: D102
    def clear_faults(self) -> None: ...  # noqa: D102
    def status(self) -> RunStatus: ...  # noqa: D102
    @property
    def newest_shot(self) -> Shot | None: ...  # noqa: D102


@dataclass(frozen=True)
class Services:
    """What the application is given.

    Parameters
    ----------
    config : RigConfig
        Configuration of the rig and the server.
    rig : Rig
        Opened devices.
    acquisition : RunControl
        The run.
    events : EventPublisher
        The one that acquisition publishes to.
    engine : Engine
        Not yet started.
    tasks : Mapping[JobKind, Task]
        Work functions.
    settings : ReconstructionSettings
        How recorded shots are reconstructed where nobody asks for anything else.
    laboratory : Laboratory | None
        What surrounds the rig, if it is simulated.
    host_names : tuple[str, ...]
        Names of this server beside the loopback ones.
    asked_every_s : float
        So often every device is asked, and the state of the rig looked at twice as often.
    """

    config: RigConfig
    rig: Rig
    acquisition: RunControl
    events: EventPublisher
    engine: Engine
    tasks: Mapping[JobKind, Task]
    settings: ReconstructionSettings = field(default_factory=ReconstructionSettings)
    laboratory: Laboratory | None = None
    host_names: tuple[str, ...] = ()
    asked_every_s: float = PERIOD_S

    @property
    def data_dir(self) -> Path:
        """Folder of the run directories."""
        return self.config.server.data_dir


@dataclass(frozen=True)
class Context:
    """What handlers and pages work with; lives as long as the application runs."""

    services: Services
    runs: RunStore
    unkept_runs: UnkeptRuns
    calibrations: CalibrationStore
    jobs: JobTable
    runner: JobRunner
    watch: CalibrationWatch
    monitor: RigMonitor
    desk: DeskWatch
    live: LiveFeed
    live_volume: LiveVolume
    parts: VolumeParts
    control: Control
    once: Once
    duties: tuple[Duty, ...]
    beat: Beat = field(default_factory=Beat)

    @property
    def lamps(self) -> tuple[Lamp, ...]:
        """Of all devices, and of the work in the background that fails."""
        return (*self.monitor.lamps, *(lamp for duty in self.duties if (lamp := duty.lamp)))

    @property
    def standing(self) -> CalibrationStanding | None:
        """How the calibration in use stood at the last check; None once another one has been chosen."""
        status, standing = self.services.acquisition.status(), self.watch.standing
        running = status.plan.calibration if status.active and status.plan else None
        in_use = (running, self.calibrations.current)
        return standing if standing is not None and standing.calibration in in_use else None
