"""RunIndex: what was read of run directories, in one SQLite file, so that a list opens no file that has not changed.

It is a cache. The directories are the truth; an index that is lost or damaged is made anew as runs are asked for.
"""

import sqlite3
import threading
import weakref
from collections.abc import Mapping
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from server.lab.runs.run_summary import RunSummary

INDEX_FILE = "runs.sqlite"
_IN_MEMORY = ":memory:"
_VERSION = 2
"""Of the table; one of another version is made anew."""


@dataclass(frozen=True, eq=False)
class IndexedRun:
    """What is known of a run.

    Parameters
    ----------
    summary : RunSummary
        As for lists.
    image_keys : (shots,) int64 array
        ImageKey of every shot.
    """

    summary: RunSummary
    image_keys: NDArray[np.int64]


class RunIndex:
    """Runs by name, each with a stamp that changes with its files; may be used from any thread.

    Parameters
    ----------
    path : Path, optional
        Database file; made if it does not exist. Without one, or where none can be, the index is forgotten at the end.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._lock = threading.Lock()
        self._there: frozenset[str] = frozenset()
        self._database = _opened(path) if path else _with_table(_IN_MEMORY)
        weakref.finalize(self, self._database.close)  # Python 3.13 complains of one that is merely forgotten

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._database.close()

    def find(self, run_id: str, stamp: str) -> IndexedRun | None:
        """What is known of a run whose files have this stamp; None if they have changed, or nothing is known."""
        query = "SELECT summary, image_keys FROM run WHERE run_id = ? AND stamp = ?"
        try:
            with self._lock:
                row = self._database.execute(query, (run_id, stamp)).fetchone()
            return row and IndexedRun(
                RunSummary.model_validate_json(row[0]), np.frombuffer(row[1], np.int8).astype(np.int64)
            )
        except (sqlite3.Error, ValidationError):
            return None  # damaged, or of an older program: read again

    def summaries(self, stamps: Mapping[str, str]) -> dict[str, RunSummary]:
        """Those that are known of many runs at once, by name; a run whose files have changed is not among them."""
        try:
            with self._lock:
                rows = self._database.execute("SELECT run_id, stamp, summary FROM run").fetchall()
            return {
                run_id: RunSummary.model_validate_json(summary)
                for run_id, stamp, summary in rows
                if stamps.get(run_id) == stamp
            }
        except (sqlite3.Error, ValidationError):
            return {}  # each is read by itself

    def keep(self, run_id: str, stamp: str, run: IndexedRun) -> None:
        """Remember a run, if the disk takes it; what was known of it is replaced."""
        row = (run_id, stamp, run.summary.model_dump_json(), run.image_keys.astype(np.int8).tobytes())
        with suppress(sqlite3.Error), self._lock, self._database:
            self._database.execute("INSERT OR REPLACE INTO run VALUES (?, ?, ?, ?)", row)

    def forget(self, run_id: str) -> None:
        """Drop what is known of a run."""
        with suppress(sqlite3.Error), self._lock, self._database:
            self._database.execute("DELETE FROM run WHERE run_id = ?", (run_id,))

    def forget_all_but(self, run_ids: frozenset[str]) -> None:
        """Drop what is known of runs that are gone."""
        if run_ids == self._there:
            return
        with suppress(sqlite3.Error), self._lock, self._database:
            known = {run_id for (run_id,) in self._database.execute("SELECT run_id FROM run")}
            self._database.executemany("DELETE FROM run WHERE run_id = ?", [(gone,) for gone in known - run_ids])
            self._there = run_ids


def _opened(path: Path) -> sqlite3.Connection:
    try:
        return _with_table(path)
    except sqlite3.Error:
        pass  # damaged: what it knew can be read again
    try:
        path.unlink(missing_ok=True)
        return _with_table(path)
    except (OSError, sqlite3.Error):
        return _with_table(_IN_MEMORY)


def _with_table(path: Path | str) -> sqlite3.Connection:
    database = sqlite3.connect(path, check_same_thread=False)
    try:
        database.execute("PRAGMA synchronous = OFF")  # what a power cut damages is read again, which costs less
        if database.execute("PRAGMA user_version").fetchone()[0] != _VERSION:
            database.execute("DROP TABLE IF EXISTS run")
        database.execute(
            "CREATE TABLE IF NOT EXISTS run "
            "(run_id TEXT PRIMARY KEY, stamp TEXT NOT NULL, summary TEXT NOT NULL, image_keys BLOB NOT NULL)"
        )
        database.execute(f"PRAGMA user_version = {_VERSION}")
        if database.execute("PRAGMA quick_check(1)").fetchone() != ("ok",):
            raise sqlite3.DatabaseError("damaged")
    except sqlite3.Error:
        with closing(database):
            raise
    return database
