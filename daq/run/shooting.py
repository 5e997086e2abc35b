"""Shooting: what all parts of one run, or of one live view, share while it is under way."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from daq.devices import Rig
from daq.run.ending import RunEnding
from daq.run.limits import AcquisitionLimits
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


@dataclass(frozen=True)
class Shooting:
    """A run or a live view under way.

    Parameters
    ----------
    rig : Rig
        Open devices.
    plan : RunPlan
        What to shoot.
    timing : ShotTiming
        Edges of every shot.
    progress : RunProgress
        Told of everything that happens.
    limits : AcquisitionLimits
        Deadlines.
    observers : tuple[RunObserver, ...]
        Who else takes part.
    ending : RunEnding
        Ends it, and says why.
    quiet : bool
        Nothing is worth a line.
    """

    rig: Rig
    plan: RunPlan
    timing: ShotTiming
    progress: RunProgress
    limits: AcquisitionLimits
    observers: tuple[RunObserver, ...] = ()
    ending: RunEnding = field(default_factory=RunEnding)
    quiet: bool = False

    def say(self, text: str) -> None:
        """Something is worth a line."""
        if not self.quiet:
            self.progress.say(text)
