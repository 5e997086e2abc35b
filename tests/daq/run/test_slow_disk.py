"""A run that is ended while shots wait for a slow disk: what was acknowledged is stored, what is not is listed."""

import errno
import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from daq.causes import CauseCode
from daq.files.run_directory import RunReader
from daq.run.acquisition import Acquisition
from daq.run.events import RunEvent, RunMessage, ShotRecorded
from daq.run.limits import AcquisitionLimits
from daq.run.state import RunOutcome
from tests.daq.run.test_acquisition import DEADLINE_S, plan_of
from tests.support.memory_rig import MemoryRig

SLOW = {"shots": 1000, "rate_hz": 50}
ENDINGS: dict[str, tuple[Callable[[Acquisition], None], RunOutcome, str]] = {
    "stop": (lambda acquisition: acquisition.stop(), RunOutcome.STOPPED, "stopped by the operator"),
    "abort": (lambda acquisition: acquisition.abort(), RunOutcome.ABORTED, "aborted by the operator"),
    "SIGTERM": (
        lambda acquisition: acquisition.leave("the server was ended by SIGTERM"),
        RunOutcome.ABORTED,
        "the server was ended by SIGTERM",
    ),
}


class Disk:
    """A disk that holds every shot back until it is let go, or what ``holds_back`` says; it may refuse something."""

    def __init__(self) -> None:
        self.moving = threading.Event()
        self.refuses: Callable[[Path], bool] = lambda _: False
        self.holds_back: Callable[[Path], bool] = lambda path: path.suffix == ".part" and path.parent.name == "shots"
        self._fsync = os.fsync

    def fsync(self, descriptor: int) -> None:
        path = Path(os.readlink(f"/proc/self/fd/{descriptor}"))
        if self.refuses(path):
            raise OSError(errno.EIO, "raw text")
        if self.holds_back(path):
            assert self.moving.wait(DEADLINE_S)
        self._fsync(descriptor)


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Iterator[Disk]:
    disk = Disk()
    monkeypatch.setattr(os, "fsync", disk.fsync)
    yield disk
    disk.moving.set()


class Trial:
    """A rig in memory on the slow disk."""

    def __init__(self, data_dir: Path, drain_s: float) -> None:
        limits = AcquisitionLimits(frame_s=0.1, light_off_s=0.2, disarm_s=0.3, drain_s=drain_s, heartbeat_s=0.05)
        self.events: list[RunEvent] = []
        self.memory = MemoryRig()
        self.acquisition = Acquisition(self.memory.rig, data_dir, self.events.append, limits=limits)
        self.reader = RunReader(data_dir / self.acquisition.start(plan_of(**SLOW)))
        self.await_fired(5)

    def await_fired(self, count: int) -> None:
        pause = threading.Event()
        for _ in range(int(DEADLINE_S / 0.005)):
            if self.memory.generator.fired >= count:
                return
            pause.wait(0.005)
        raise AssertionError(f"{self.memory.generator.fired} of {count} shots were fired")

    @property
    def acknowledged(self) -> list[int]:
        return [event.index for event in self.events if isinstance(event, ShotRecorded)]

    @property
    def messages(self) -> list[str]:
        return [event.text for event in self.events if isinstance(event, RunMessage)]

    @property
    def committed(self) -> list[int]:
        return sorted(int(path.stem) for path in (self.reader.run_dir / "shots").glob("*.h5"))


@pytest.mark.parametrize("how", ENDINGS)
def test_what_waits_for_the_disk_is_stored_however_the_run_ends(tmp_path: Path, disk: Disk, how: str) -> None:
    end, outcome, cause = ENDINGS[how]
    trial = Trial(tmp_path, drain_s=DEADLINE_S)
    end(trial.acquisition)
    disk.moving.set()
    assert trial.acquisition.wait(DEADLINE_S).outcome is outcome
    assert (trial.reader.outcome, trial.reader.cause) == (outcome, cause)
    fired = list(range(trial.memory.generator.fired))
    assert trial.committed == trial.acknowledged
    assert [*trial.committed, *trial.reader.unstored] == fired, "every shot that was fired is stored, or listed"
    assert len(trial.committed) >= 4
    assert all(trial.reader.read_shot(index).valid for index in trial.committed)


def test_what_a_disk_does_not_take_in_time_is_listed_and_does_not_come_later(tmp_path: Path, disk: Disk) -> None:
    trial = Trial(tmp_path, drain_s=0.2)
    trial.acquisition.stop()
    status = trial.acquisition.wait(DEADLINE_S)
    fired = tuple(range(trial.memory.generator.fired))
    assert status.outcome is RunOutcome.FAILED
    assert "shots are not stored after 0.2 s" in status.message
    assert [cause.code for cause in trial.reader.causes] == [CauseCode.DISK_SLOW]
    assert trial.reader.unstored == fired
    assert f"fired and not stored: shots {', '.join(map(str, fired))}" in trial.messages
    disk.moving.set()
    for thread in threading.enumerate():
        if thread.name.startswith("recorder"):
            thread.join(DEADLINE_S)
    assert trial.committed == trial.acknowledged == []
    assert not list(trial.reader.run_dir.rglob("*.part"))


def test_a_full_queue_ends_the_run_and_lists_what_it_did_not_take(tmp_path: Path, disk: Disk) -> None:
    trial = Trial(tmp_path, drain_s=DEADLINE_S)
    trial.await_fired(9)
    while not trial.acquisition.status().message:
        threading.Event().wait(0.005)
    disk.moving.set()
    status = trial.acquisition.wait(DEADLINE_S)
    assert status.outcome is RunOutcome.FAILED
    assert "shot 8: 8 shots wait already, the disk does not keep up" in status.message
    assert [cause.code for cause in trial.reader.causes] == [CauseCode.DISK_SLOW]
    assert trial.committed == trial.acknowledged == list(range(8))
    assert trial.reader.unstored == (8,)


def test_a_disk_that_hangs_at_the_outcome_ends_the_run_all_the_same(tmp_path: Path, disk: Disk) -> None:
    def is_last_copy(path: Path) -> bool:
        return path.name == "run.h5.reserve" and (path.parent / "shots" / "4.h5").exists()

    disk.holds_back = is_last_copy
    trial = Trial(tmp_path, drain_s=1.0)
    trial.acquisition.stop()
    assert trial.acquisition.wait(DEADLINE_S).outcome is RunOutcome.STOPPED
    assert trial.reader.outcome is None
    disk.moving.set()
    pause = threading.Event()
    while "its outcome is in its file now: stopped" not in trial.messages:
        pause.wait(0.01)
    closing = trial.reader.closing
    assert closing is not None
    assert (closing.outcome, closing.cause) == ("stopped", "stopped by the operator")
    refused = "its outcome could not be written, that is tried until the disk takes it: the disk does not answer"
    assert refused in trial.messages


def test_an_outcome_that_was_written_although_the_disk_complained_is_not_written_again(
    tmp_path: Path, disk: Disk
) -> None:
    def is_folder_of_closed_run(path: Path) -> bool:
        return (path / "run.h5").exists() and not (path / "run.h5.reserve").exists()

    disk.moving.set()
    disk.refuses = is_folder_of_closed_run
    trial = Trial(tmp_path, drain_s=DEADLINE_S)
    trial.acquisition.stop()
    trial.acquisition.wait(DEADLINE_S)
    pause = threading.Event()
    while not any("its outcome is in its file now" in text for text in trial.messages):
        pause.wait(0.01)
    assert trial.reader.outcome == "stopped"
