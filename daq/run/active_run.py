"""ActiveRun: what all parts of one run share while it is under way."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from daq.devices import Rig
from daq.run.ending import RunEnding
from daq.run.limits import AcquisitionLimits
from daq.run.preflight import PreparedRun
from daq.run.progress import RunProgress
from daq.run_plan import RunPlan
from daq.timing import ShotTiming


class RunObserver(Protocol):
    """Who takes part in runs without being a device. Called by the acquisition thread, outside of all locks.

    An error of an observer fails the run.
    """

    def before_run(self, plan: RunPlan, run_dir: Path | None) -> None:
        """Before any device is asked for anything; the run has its directory, a live view has none."""

    def after_run(self, run_dir: Path) -> None:
        """After the last shot is on the disk, before the outcome is."""


class Shooting(Protocol):
    """What it takes to fire shots: a run under way is that, and so is a live view."""

    @property
    def rig(self) -> Rig: ...  # noqa: D102
    @property
    def plan(self) -> RunPlan: ...  # noqa: D102
    @property
    def timing(self) -> ShotTiming: ...  # noqa: D102
    @property
    def limits(self) -> AcquisitionLimits: ...  # noqa: D102
    @property
    def ending(self) -> RunEnding: ...  # noqa: D102

    def say(self, text: str) -> None:
        """Something is worth a line."""


@dataclass(frozen=True)
class ActiveRun:
    """One run under way.

    Parameters
    ----------
    rig : Rig
        Open devices.
    prepared : PreparedRun
        What to do.
    progress : RunProgress
        Told of everything that happens.
    limits : AcquisitionLimits
        Deadlines.
    observers : tuple[RunObserver, ...]
        Who else takes part.
    ending : RunEnding
        Ends the run early, and says how it ended.
    """

    rig: Rig
    prepared: PreparedRun
    progress: RunProgress
    limits: AcquisitionLimits
    observers: tuple[RunObserver, ...] = ()
    ending: RunEnding = field(default_factory=RunEnding)

    @property
    def plan(self) -> RunPlan:
        """As the operator wrote it."""
        return self.prepared.plan

    @property
    def timing(self) -> ShotTiming:
        """Edges of every shot."""
        return self.prepared.timing

    def say(self, text: str) -> None:
        """Something is worth a line."""
        self.progress.say(text)
