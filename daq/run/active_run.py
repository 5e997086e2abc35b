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


class RunObserver(Protocol):
    """Who takes part in runs without being a device. Called by the acquisition thread, outside of all locks.

    An error of an observer fails the run.
    """

    def before_run(self, plan: RunPlan) -> None:
        """Before any device is asked for anything."""

    def after_run(self, run_dir: Path) -> None:
        """After the last shot is on the disk, before the outcome is."""


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
