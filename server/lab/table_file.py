"""Tables that lie in SQLite files: what the disk refuses is told as it is of every other file."""

import errno
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock

from daq.files.storage import storing

_NUMBERS = {sqlite3.SQLITE_FULL: errno.ENOSPC, sqlite3.SQLITE_READONLY: errno.EROFS}


def table_at(path: Path, script: str) -> sqlite3.Connection:
    """A database that any thread may use, once a script has been run in it; closed where that fails."""
    database = sqlite3.connect(path, check_same_thread=False, isolation_level=None)
    try:
        database.executescript(script)
    except sqlite3.Error:
        database.close()
        raise
    return database


@contextmanager
def changing(database: sqlite3.Connection, lock: Lock, path: Path) -> Iterator[None]:
    """Change a table, alone; StorageError if the disk does not take it."""
    with storing(path), lock:
        try:
            with database:
                yield
        except sqlite3.OperationalError as error:
            number = _NUMBERS.get(error.sqlite_errorcode & 0xFF, errno.EIO)  # the rest tells details
            raise OSError(number, str(error), str(path)) from error
