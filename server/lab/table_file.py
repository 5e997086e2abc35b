"""Changing a table that lies in a SQLite file: what the disk refuses is told as it is of every other file."""

import errno
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock

from daq.files.storage import storing

_NUMBERS = {sqlite3.SQLITE_FULL: errno.ENOSPC, sqlite3.SQLITE_READONLY: errno.EROFS}


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
