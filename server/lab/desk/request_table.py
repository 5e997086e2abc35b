"""RequestTable: keys of requests that were obeyed, on the disk: a restart of the server repeats none of them."""

import json
import sqlite3
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from server.lab.damage import set_aside, tell
from server.lab.events import EventPublisher
from server.lab.table_file import table_at

REQUESTS_FILE = "requests.sqlite"
_KEPT = 10_000


@dataclass(frozen=True)
class Obeyed:
    """What is known of a key: the whole request, whether it was answered, and how."""

    what: str
    is_answered: bool
    answer: Any


_TABLE = """
    PRAGMA journal_mode = WAL; PRAGMA synchronous = NORMAL;
    CREATE TABLE IF NOT EXISTS request (
        number INTEGER PRIMARY KEY, key TEXT NOT NULL UNIQUE, what TEXT NOT NULL, answer TEXT
    );
    SELECT number, key, what, answer FROM request LIMIT 1;
"""


class RequestTable:
    """The newest requests that had a key, in one SQLite file; from any thread.

    A request is obeyed although the disk takes or gives nothing: then no later life of the server knows of it.

    Parameters
    ----------
    path : Path
        Database file; made if it does not exist.
    kept : int
        How many of them.
    tell : Callable[[sqlite3.Error], object]
        Told when the file refuses for the first time.
    """

    def __init__(self, path: Path, kept: int = _KEPT, tell: Callable[[sqlite3.Error], object] = repr) -> None:
        self._kept = kept
        self._tell = tell
        self._is_told = False
        self._lock = threading.Lock()
        self._database = table_at(path, _TABLE)

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._database.close()

    def find(self, key: str) -> Obeyed | None:
        """What is known of a key."""
        found = self._ask("SELECT what, answer FROM request WHERE key = ?", key)
        return _obeyed(*found[0]) if found else None

    def begin(self, key: str, what: str) -> None:
        """A request is about to be obeyed; the oldest of too many is forgotten."""
        self._ask("INSERT OR REPLACE INTO request (key, what) VALUES (?, ?)", key, what)
        self._ask("DELETE FROM request WHERE number <= (SELECT MAX(number) FROM request) - ?", self._kept)

    def end(self, key: str, answer: Any) -> None:
        """It was obeyed; the answer is made of what JSON knows."""
        self._ask("UPDATE request SET answer = ? WHERE key = ?", json.dumps(answer), key)

    def drop(self, key: str) -> None:
        """It was refused, and may be asked for again."""
        self._ask("DELETE FROM request WHERE key = ?", key)

    def _ask(self, statement: str, *values: str | int) -> list[Any]:
        """What the file answers; nothing where it refuses, which is told once."""
        try:
            with self._lock:
                return self._database.execute(statement, values).fetchall()
        except sqlite3.Error as error:
            if not self._is_told:
                self._is_told = True
                self._tell(error)
            return []


def _obeyed(what: str, answer: str | None) -> Obeyed:
    try:
        return Obeyed(what, answer is not None, None if answer is None else json.loads(answer))
    except ValueError:  # damaged
        return Obeyed(what, False, None)


@contextmanager
def opened_requests(path: Path, events: EventPublisher, kept: int = _KEPT) -> Iterator[RequestTable]:
    """The table of a data directory until the block ends; one that cannot be read is set aside."""
    lost = "a request that is repeated after a restart is obeyed again"

    def refusing(error: sqlite3.Error) -> None:
        tell(path, f"table of requests, {error}: {lost}", events)

    try:
        table = RequestTable(path, kept, refusing)
    except sqlite3.Error as error:
        set_aside(path, f"table of requests, {error}: {lost}", events, ("-wal", "-shm"))
        table = RequestTable(path, kept, refusing)
    with closing(table):
        yield table
