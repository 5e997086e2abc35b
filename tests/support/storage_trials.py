"""Runs whose disk fails, on small file systems of their own; needs a mount namespace, prints an object for each.

``unshare -rm setpriv --bounding-set -dac_override,-dac_read_search python -m tests.support.storage_trials FOLDER``:
without these two capabilities permissions bind the superuser too.
"""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

from daq.errors import PlanError
from daq.files.run_directory import PulsePair, RunPlan, RunReader
from daq.run.acquisition import Acquisition
from daq.run.events import RunEvent, RunMessage, ShotRecorded
from daq.run.limits import AcquisitionLimits
from tests.support.memory_rig import MemoryRig

DISK_BYTES, MARGIN_BYTES = 4 * 2**20, 2**20
DEADLINE_S = 20.0
LIMITS = AcquisitionLimits(frame_s=0.1, light_off_s=1, disarm_s=1, drain_s=10, heartbeat_s=0.05, disk_margin_bytes=0)
PLAN = RunPlan(name="disk", shots=300, rate_hz=50, pulse=PulsePair(current_a={"view1": 20.0, "view2": 12.0}))


class Trial:
    """A run on a disk of its own, and what becomes of it."""

    def __init__(self, folder: Path, limits: AcquisitionLimits = LIMITS) -> None:
        self.disk = folder / "disk"
        self.disk.mkdir(parents=True)
        _mount("-t", "tmpfs", "-o", f"size={DISK_BYTES}", "trial", self.disk)
        self.memory = MemoryRig()
        self.events: list[RunEvent] = []
        self._told = threading.Condition()
        self.acquisition = Acquisition(self.memory.rig, self.disk / "runs", self._publish, limits=limits).__enter__()
        self.run_dir = self.disk / "runs" / self.acquisition.start(PLAN)
        self.until(lambda: self.recorded > 2)

    @property
    def recorded(self) -> int:
        return sum(isinstance(event, ShotRecorded) for event in self.events)

    @property
    def messages(self) -> list[str]:
        return [event.text for event in self.events if isinstance(event, RunMessage)]

    def until(self, is_so: Callable[[], bool]) -> None:
        with self._told:
            assert self._told.wait_for(is_so, DEADLINE_S)

    def end(self, run_dir: Path | None = None) -> dict[str, object]:
        """Wait for the end of the run; what status and file say."""
        status = self.acquisition.wait(DEADLINE_S)
        reader = RunReader(run_dir or self.run_dir)
        journal = self.memory.journal
        return {
            "status": {"outcome": status.outcome, "message": status.message},
            "closing": reader.closing and asdict(reader.closing),
            "codes": [cause.code for cause in reader.causes],
            "acknowledged": self.recorded,
            "unstored": reader.unstored,
            "fired": self.memory.generator.fired,
            "readable": sum(reader.read_shot(index).valid for index in range(reader.shot_count)),
            "parts": [path.name for path in (run_dir or self.run_dir).rglob("*.part")],
            "light_first": journal.index("off") < journal.index("view1 disarm"),
        }

    def _publish(self, event: RunEvent) -> None:
        with self._told:
            self.events.append(event)
            self._told.notify_all()


def filled_by_the_run(folder: Path) -> dict[str, object]:
    trial = Trial(folder, AcquisitionLimits(**{**asdict(LIMITS), "disk_margin_bytes": MARGIN_BYTES}))
    return {**trial.end(), "run_dir": str(trial.run_dir), "free": _free_bytes(trial.disk)}


def filled_by_others(folder: Path) -> dict[str, object]:
    trial = Trial(folder)
    with (trial.disk / "others").open("wb", buffering=0) as others, suppress(OSError):
        while True:
            others.write(bytes(4096))
    return {**trial.end(), "run_dir": str(trial.run_dir), "free": _free_bytes(trial.disk)}


def moved(folder: Path) -> dict[str, object]:
    trial = Trial(folder)
    trial.run_dir.rename(trial.disk / "away")
    return {**trial.end(trial.disk / "away"), "run_dir": str(trial.run_dir)}


def unmounted(folder: Path) -> dict[str, object]:
    trial = Trial(folder)
    second = folder / "second"
    second.mkdir()
    _mount("--bind", trial.disk, second)
    subprocess.run(["umount", "--lazy", trial.disk], check=True)
    found = trial.end(second / "runs" / trial.run_dir.name)
    try:
        refused = trial.acquisition.start(PLAN)
    except PlanError as error:
        refused = str(error)
    return {**found, "run_dir": str(trial.run_dir), "refused": refused, "left_behind": os.listdir(trial.disk)}


def read_only_for_a_while(folder: Path) -> dict[str, object]:
    trial = Trial(folder)
    remount = ["mount", "-o", "remount,ro", str(trial.disk)]
    for _ in range(500):  # busy while a shot is being written
        if not subprocess.run(remount, capture_output=True, check=False).returncode:
            break
    return _mended(trial, lambda: _mount("-o", "remount,rw", trial.disk))


def forbidden_for_a_while(folder: Path) -> dict[str, object]:
    trial = Trial(folder)
    _permit(trial.run_dir, 0o500)
    return _mended(trial, lambda: _permit(trial.run_dir, 0o700))


def forbidden_until_the_end(folder: Path) -> dict[str, object]:
    trial = Trial(folder)
    _permit(trial.run_dir, 0o500)
    found = trial.end()
    trial.acquisition.__exit__(None, None, None)
    return {**found, "note": json.loads((trial.run_dir.parent / f"{trial.run_dir.name}.outcome.json").read_text())}


def _mended(trial: Trial, mend: Callable[[], None]) -> dict[str, object]:
    before = trial.end()
    mend()
    trial.until(lambda: any("is in its file now" in text for text in trial.messages))
    return {**trial.end(), "before": before["closing"], "run_dir": str(trial.run_dir), "messages": trial.messages}


def _permit(run_dir: Path, mode: int) -> None:
    for folder in (run_dir / "shots", run_dir):
        folder.chmod(mode)


def _mount(*arguments: object) -> None:
    subprocess.run(["mount", *map(str, arguments)], check=True)


def _free_bytes(path: Path) -> int:
    status = os.statvfs(path)
    return status.f_bavail * status.f_frsize


TRIALS = (
    filled_by_the_run,
    filled_by_others,
    moved,
    unmounted,
    read_only_for_a_while,
    forbidden_for_a_while,
    forbidden_until_the_end,
)

if __name__ == "__main__":
    for trial in TRIALS:
        if len(sys.argv) < 3 or trial.__name__ in sys.argv[2:]:
            found = trial(Path(sys.argv[1]) / trial.__name__)
            sys.stdout.write(json.dumps({"trial": trial.__name__, **found}) + "\n")
