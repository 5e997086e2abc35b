"""UnkeptRuns: runs of one shot that the next one removes, unless somebody keeps them.

A single shot is a run like any other, so whatever reads runs reads it. That it may be removed stands beside the runs,
in ``unkept_runs``, one id a line: a run that is not named there is kept, whatever becomes of that file.
"""

import shutil
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from daq.errors import ShotFileError, StorageError
from daq.files.atomic_file import replacing
from daq.files.run_directory import RunReader
from daq.files.storage import storing
from daq.names import is_identifier
from server.lab.jobs.job import JobState
from server.lab.jobs.job_table import JobTable

UNKEPT_FILE = "unkept_runs"


class UnkeptRuns:
    """The single shots of one data directory that nobody has kept.

    Parameters
    ----------
    data_dir : Path
        Folder of the run directories.
    jobs : JobTable
        A run that is being worked on stays until it is not.
    """

    def __init__(self, data_dir: Path, jobs: JobTable) -> None:
        self._data_dir = data_dir
        self._file = data_dir / UNKEPT_FILE
        self._jobs = jobs
        self._changing = threading.Lock()
        self._ids = self._stored()

    @property
    def ids(self) -> tuple[str, ...]:
        """Oldest first; never waits."""
        return self._ids

    def has(self, run_id: str) -> bool:
        """Whether a run is one of them; waits for one that is just being started."""
        with self._changing:
            return run_id in self._ids

    def add(self, start: Callable[[], str]) -> str:
        """Start a run that may be removed, and remove those before it; returns its id. Those stay if it is refused."""
        with self._changing:
            run_id, before = start(), self._ids
            with suppress(StorageError):  # a disk that does not take the note: then the shot is kept
                self._store((*before, run_id))
                self._store((*(old for old in before if not self._remove(old)), run_id))
            return run_id

    def keep(self, run_id: str) -> None:
        """Let a run stay; one that stays anyway is left as it is. StorageError if the disk does not take the note."""
        with self._changing:
            if run_id in self._ids:
                self._store(tuple(one for one in self._ids if one != run_id))

    def _remove(self, run_id: str) -> bool:
        """Remove a run and its jobs; False if that has to wait."""
        if self._jobs.newest(run_id, [JobState.QUEUED, JobState.RUNNING], 1):
            return False
        run_dir = self._data_dir / run_id
        if _is_single_shot(run_dir):
            shutil.rmtree(run_dir, ignore_errors=True)
            self._jobs.forget(run_id)
        return True

    def _stored(self) -> tuple[str, ...]:
        try:
            return tuple(line for line in self._file.read_text().splitlines() if is_identifier(line))
        except (OSError, ValueError):
            return ()

    def _store(self, ids: tuple[str, ...]) -> None:
        with storing(self._data_dir), replacing(self._file) as part:
            part.write_text("".join(f"{run_id}\n" for run_id in ids))
        self._ids = ids


def _is_single_shot(run_dir: Path) -> bool:
    """Whatever else the file names is not removed."""
    try:
        plan = RunReader(run_dir).header.plan
    except ShotFileError:
        return False
    return plan is not None and plan.total_shots == 1
