"""RunStore: what lies in the run directories, for lists and pages. The directories are the truth."""

import os
import re
import threading
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from functools import lru_cache
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from daq.errors import ShotFileError
from daq.files.later_notes import NOTES_FILE
from daq.files.packed_file import holds_its_shots
from daq.files.run_directory import RunReader, list_runs
from daq.files.run_file import RUN_FILE, SHOTS_FOLDER, shot_path
from daq.files.shot_file import read_image_key
from daq.names import is_identifier
from daq.run.events import RunStatus
from daq.run.state import RunOutcome
from daq.run_plan import RunKind
from server.lab.errors import Conflict, NotFound
from server.lab.runs.run_filter import EVERY_RUN, RunFilter
from server.lab.runs.run_index import IndexedRun, RunIndex
from server.lab.runs.run_summary import (
    ACTIVE,
    DAMAGED,
    PACKED,
    RunSummary,
    summary_of,
    summary_of_absent,
    summary_of_damaged,
    summary_of_misnamed,
    summary_of_packed,
)

_ALL = 10**9
_NO_ID = "{!r} is no id of a run, which has letters, digits, space . _ - and begins with one of the first two"
_TIME = "%Y%m%dT%H%M%S"
_TIME_IN_ID = re.compile(r"\d{8}T\d{6}(?=-)")


class RunStore:
    """Run directories in one folder.

    Parameters
    ----------
    data_dir : Path
        Folder of the run directories.
    status : Callable[[], RunStatus]
        Asked which run is active: any other one without an outcome was interrupted.
    index : RunIndex, optional
        Remembers what was read; by default for as long as the store lives.
    """

    def __init__(self, data_dir: Path, status: Callable[[], RunStatus], index: RunIndex | None = None) -> None:
        self._data_dir = data_dir
        self._status = status
        self._index = index or RunIndex()
        self._shots = _ShotKeys()
        self._removed = set[str]()

    def directory(self, run_id: str) -> Path:
        """Directory of a run; NotFound if there is none."""
        path = self._data_dir / run_id
        if not is_identifier(run_id):
            raise NotFound(f"{_NO_ID.format(run_id)}: rename the folder, if there is one")
        if not self.has(run_id):
            raise NotFound(f"there is no run {run_id!r}")
        return path

    def has(self, run_id: str) -> bool:
        """Whether the file of a run is there."""
        return is_identifier(run_id) and (self._data_dir / run_id / RUN_FILE).is_file()

    def reader(self, run_id: str) -> RunReader:
        """Reader of a run; NotFound if there is none."""
        return RunReader(self.directory(run_id))

    def summary(self, run_id: str) -> RunSummary:
        """What a run is and how it went, although its directory may be gone now; NotFound if there is none."""
        status = self._status()
        is_lost = run_id not in self._removed and not self.has(run_id)
        if status.run_id == run_id and status.plan and is_lost:
            return summary_of_absent(run_id, status, status.plan)
        return self._summary_of(self.directory(run_id))

    def require_sound(self, summary: RunSummary) -> None:
        """Raise ShotFileError if the shots of a run cannot be read."""
        if summary.outcome in (DAMAGED, PACKED):
            raise ShotFileError(f"run {summary.run_id}: {summary.cause}; {summary.remedy}")

    def require_closed(self, run_id: str) -> None:
        """Raise Conflict if a run is being recorded."""
        if self._is_active(self.directory(run_id)):
            raise Conflict(f"run {run_id} is being recorded: stop it first")

    def image_keys(self, run_id: str) -> NDArray[np.int64]:
        """ImageKey of every shot of a run, (shot,); INVALID where one cannot be read.

        Raises
        ------
        NotFound
            There is no such run.
        ShotFileError
            The run is damaged.
        """
        run_dir = self.directory(run_id)
        if self._is_active(run_dir):
            return self._shots.so_far(RunReader(run_dir))
        return self._indexed(run_dir).image_keys

    def newest(self, limit: int = 100, offset: int = 0) -> list[RunSummary]:
        """Runs, newest first by their own time, whatever has been done to their directories since."""
        return self.page(limit, offset)[0]

    def page(self, limit: int, offset: int, wanted: RunFilter = EVERY_RUN) -> tuple[list[RunSummary], int]:
        """Some of the runs that are wanted, as ``newest`` has them, and how many of those there are.

        Nothing is read of the other pages of a list of all runs.
        """
        directories = self._by_age()
        if not wanted.takes_all:
            directories = self._wanted(directories, wanted)
        return [self._summary_of(path) for path in directories[offset : offset + limit]], len(directories)

    def newest_that(self, is_wanted: Callable[[RunSummary], bool], limit: int) -> list[RunSummary]:
        """The newest runs that are wanted, however many others were made since; nothing is read of older ones."""
        found = (run for path in self._by_age() if is_wanted(run := self._summary_of(path)))
        return list(islice(found, limit))

    def references(self, kind: RunKind, limit: int = 1) -> list[RunSummary]:
        """The newest completed runs of a kind, which others may name as their references."""
        return self.newest_that(lambda run: run.kind is kind and run.outcome == RunOutcome.COMPLETED, limit)

    def with_results(self, limit: int) -> list[RunSummary]:
        """The newest runs of which something came."""
        found = (path for path in self._by_age() if has_results(path))
        return [self._summary_of(path) for path in islice(found, limit)]

    def referring_to(self, run_id: str) -> tuple[str, ...]:
        """Runs that name this one as a reference, newest first."""
        wanted = RunFilter(text=run_id)
        return tuple(run.run_id for run in self.page(_ALL, 0, wanted)[0] if run_id in run.references)

    def forget(self, run_id: str) -> None:
        """Drop what is remembered of a run that has been removed."""
        self._removed.add(run_id)
        self._index.forget(run_id)

    def _wanted(self, directories: list[Path], wanted: RunFilter) -> list[Path]:
        if wanted.results is not None:
            directories = [path for path in directories if has_results(path) == wanted.results]
        status = self._status()
        stamps = {path.name: _stamp(path) for path in directories if not self._is_active(path)}
        known = self._index.summaries(stamps)

        def summary_of_one(path: Path) -> RunSummary:
            return _closed(known[path.name], status) if path.name in known else self._summary_of(path)

        return [path for path in directories if wanted.accepts(summary_of_one(path))]

    def _by_age(self) -> list[Path]:
        """All run directories, the newest first.

        Ids tell it to the second, so that a long list need not be read; headers tell two of the same second apart.
        """
        directories = list_runs(self._data_dir)
        self._index.forget_all_but(frozenset(path.name for path in directories))
        seconds = {path: self._second(path) for path in directories}
        crowd = Counter(seconds.values())

        def age(path: Path) -> tuple[str, str]:
            second = seconds[path]
            return second, self._created(path).isoformat() if crowd[second] > 1 else ""

        return sorted(directories, key=age, reverse=True)

    def _is_active(self, run_dir: Path) -> bool:
        status = self._status()
        return status.active and status.run_id == run_dir.name

    def _summary_of(self, run_dir: Path) -> RunSummary:
        if not is_identifier(run_dir.name):
            return summary_of_misnamed(run_dir, self._started(run_dir), _NO_ID.format(run_dir.name))
        try:
            if not self._is_active(run_dir):
                return _closed(self._indexed(run_dir).summary, self._status())
            recorded = self._status().shots_recorded
            begun = _begun(run_dir, _changed_ns(run_dir / RUN_FILE))
            return begun.model_copy(update={"outcome": ACTIVE, "shots_recorded": recorded, "shots_valid": None})
        except ShotFileError as error:
            return self._unreadable(run_dir, error)

    def _unreadable(self, run_dir: Path, error: ShotFileError) -> RunSummary:
        """A run of which no shot can be read: it hides no other."""
        with suppress(ShotFileError):
            if not (run_dir / SHOTS_FOLDER).is_dir() and holds_its_shots(run_dir):
                return summary_of_packed(RunReader(run_dir))
        return summary_of_damaged(run_dir, self._started(run_dir), str(error))

    def _indexed(self, run_dir: Path) -> IndexedRun:
        """What is known of a run that is not active: read again where its files have changed."""
        stamp = _stamp(run_dir)
        if known := self._index.find(run_dir.name, stamp):
            return known
        run = RunReader(run_dir)
        keys = self._shots.all(run)
        read = IndexedRun(summary_of(run, keys), keys)
        self._index.keep(run_dir.name, stamp, read)
        return read

    def _second(self, run_dir: Path) -> str:
        """When a run was started. Its id says so, as its header does; imported runs have no time in their ids."""
        written = _TIME_IN_ID.match(run_dir.name)
        return written[0] if written else f"{self._created(run_dir):{_TIME}}"

    def _started(self, run_dir: Path) -> datetime:
        """As far as a run tells that cannot be read."""
        try:
            return datetime.strptime(self._second(run_dir), _TIME).replace(tzinfo=UTC)
        except ValueError:  # digits, but no time
            return self._created(run_dir)

    def _created(self, run_dir: Path) -> datetime:
        known = self._index.find(run_dir.name, _stamp(run_dir))
        written = known.summary.created_utc if known else None
        return _created(run_dir, _changed_ns(run_dir / RUN_FILE), written)


class _ShotKeys:
    """ImageKeys of the run that was asked for last: while it grows each shot is read once."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._run_dir = Path()
        self._shots_ns = 0
        self._keys: list[int] = []

    def so_far(self, run: RunReader) -> NDArray[np.int64]:
        """ImageKey of every shot of a run that grows, (shot,); INVALID where one cannot be read."""
        with self._lock:
            if run.run_dir != self._run_dir:
                self._run_dir, self._keys = run.run_dir, []
            self._shots_ns = _changed_ns(run.run_dir / SHOTS_FOLDER)
            paths = (shot_path(run.run_dir, index) for index in range(len(self._keys), run.shot_count))
            self._keys += [int(read_image_key(path)) for path in paths]
            return np.array(self._keys, np.int64)

    def all(self, run: RunReader) -> NDArray[np.int64]:
        """ImageKey of every shot of a run that grows no more: shots may have been lost or repaired."""
        with self._lock:
            is_same = (run.run_dir, _changed_ns(run.run_dir / SHOTS_FOLDER)) == (self._run_dir, self._shots_ns)
            return np.array(self._keys, np.int64) if is_same else run.image_keys()


def has_results(run_dir: Path) -> bool:
    """Whether anything came of a run."""
    return os.path.isdir(f"{run_dir}/results") and any(run_dir.glob("results/*/settings.json"))


def _closed(read: RunSummary, status: RunStatus) -> RunSummary:
    """A run that is not active: acquisition knows how its last one ended, although no file may say it."""
    if status.run_id != read.run_id or read.outcome != RunOutcome.INTERRUPTED:
        return read
    return read.model_copy(update={"outcome": status.outcome or RunOutcome.FAILED, "cause": status.message})


def _stamp(run_dir: Path) -> str:
    folder = str(run_dir)  # of thousands of runs: paths are joined slowly
    return " ".join(str(_changed_ns(f"{folder}/{name}")) for name in (RUN_FILE, SHOTS_FOLDER, NOTES_FILE))


def _changed_ns(path: Path | str) -> int:
    """When a file or folder was changed; 0 if it is gone."""
    try:
        return os.stat(path).st_mtime_ns
    except OSError:
        return 0


@lru_cache(maxsize=2)
def _begun(run_dir: Path, _changed_ns: int) -> RunSummary:
    """An active run, without its shots; read once."""
    return summary_of(RunReader(run_dir), np.empty(0, np.int64))


@lru_cache(maxsize=65_536)
def _created(run_dir: Path, changed_ns: int, written: str | None) -> datetime:
    """What the header says; if nobody can read it, when its file was changed."""
    try:
        created = datetime.fromisoformat(written or RunReader(run_dir).header.created_utc)
    except (ShotFileError, ValueError):
        return datetime.fromtimestamp(changed_ns / 1e9, UTC)
    return created if created.tzinfo else created.replace(tzinfo=UTC)
