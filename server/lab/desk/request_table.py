"""RequestTable: keys of requests that were obeyed, on the disk: a restart of the server repeats none of them."""

import json
import sqlite3
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from server.lab.damage import set_aside
from server.lab.events import EventPublisher

REQUESTS_FILE = "requests.sqlite"
_KEPT = 10_000


@dataclass(frozen=True)
class Obeyed:
    """What is known of a key: the whole request, whether it was answered, and how."""

    what: str
    is_answered: bool
    answer: Any


class RequestTable:
    """The newest requests that had a key, in one SQLite file; from any thread.

    Parameters
    ----------
    path : Path
        Database file; made if it does not exist.
    kept : int
        How many of them.
    """

    def __init__(self, path: Path, kept: int = _KEPT) -> None:
        self._kept = kept
        self._lock = threading.Lock()
        self._database = sqlite3.connect(path, check_same_thread=False, isolation_level=None)
        self._database.executescript("""
            PRAGMA journal_mode = WAL;
            PRAGMA synchronous = NORMAL;
            CREATE TABLE IF NOT EXISTS request (
                number INTEGER PRIMARY KEY, key TEXT NOT NULL UNIQUE, what TEXT NOT NULL, answer TEXT
            );
            SELECT number, key, what, answer FROM request LIMIT 1;
        """)

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._database.close()

    def find(self, key: str) -> Obeyed | None:
        """What is known of a key."""
        with self._lock:
            row = self._database.execute("SELECT what, answer FROM request WHERE key = ?", (key,)).fetchone()
        if row is None:
            return None
        what, answer = row
        return Obeyed(what, answer is not None, None if answer is None else json.loads(answer))

    def begin(self, key: str, what: str) -> None:
        """A request is about to be obeyed; the oldest of too many is forgotten."""
        with self._lock, self._database:
            self._database.execute("INSERT OR REPLACE INTO request (key, what) VALUES (?, ?)", (key, what))
            self._database.execute(
                "DELETE FROM request WHERE number <= (SELECT MAX(number) FROM request) - ?", (self._kept,)
            )

    def end(self, key: str, answer: Any) -> None:
        """It was obeyed; the answer is made of what JSON knows."""
        with self._lock, self._database:
            self._database.execute("UPDATE request SET answer = ? WHERE key = ?", (json.dumps(answer), key))

    def drop(self, key: str) -> None:
        """It was refused, and may be asked for again."""
        with self._lock, self._database:
            self._database.execute("DELETE FROM request WHERE key = ?", (key,))


@contextmanager
def opened_requests(path: Path, events: EventPublisher, kept: int = _KEPT) -> Iterator[RequestTable]:
    """The table of a data directory until the block ends; one that cannot be read is set aside."""
    try:
        table = RequestTable(path, kept)
    except sqlite3.Error as error:
        lost = "a request that is repeated after a restart is obeyed again"
        set_aside(path, f"table of requests, {error}: {lost}", events, ("-wal", "-shm"))
        table = RequestTable(path, kept)
    with closing(table):
        yield table
