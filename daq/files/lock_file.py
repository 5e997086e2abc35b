"""Lock files: one process at a time holds a thing. The kernel lets go when that ends, however it ends."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path

from daq.errors import AlreadyHeld

_LONGEST_SIGNATURE = 200


@contextmanager
def hold(path: Path, what: str) -> Iterator[None]:
    """Hold a lock file, which is made if need be and never removed, until the block ends.

    Parameters
    ----------
    path : Path
        The file; its folder exists.
    what : str
        What it stands for, for the error.

    Raises
    ------
    AlreadyHeld
        Somebody else holds it, in this process or another; the text says who, and since when.
    OSError
        The file cannot be made or opened.
    """
    descriptor = _opened(path)
    try:
        _lock(descriptor, what)
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, f"process {os.getpid()}, since {datetime.now(UTC):%Y-%m-%d %H:%M:%S} UTC".encode(), 0)
        yield
    finally:
        os.close(descriptor)


@contextmanager
def hold_folder(folder: Path) -> Iterator[Path]:
    """Hold a folder until the block ends; yields a path that leads to it even if it is moved.

    Raises
    ------
    AlreadyHeld
        Another one holds it: what lies there is being written.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with suppress(OSError):  # a file system of the network may have no such locks
            _lock_folder(descriptor, folder)
        yield Path(f"/proc/self/fd/{descriptor}")
    finally:
        os.close(descriptor)


def _lock_folder(descriptor: int, folder: Path) -> None:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise AlreadyHeld(f"{folder} is being written by a living process: end that first") from error


def _opened(path: Path) -> int:
    """Whoever may use the rig may hold it: a file that another user has made is opened, never made again."""
    try:
        return os.open(path, os.O_RDWR)
    except FileNotFoundError:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        os.fchmod(descriptor, 0o666)
        return descriptor


def _lock(descriptor: int, what: str) -> None:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        holder = os.pread(descriptor, _LONGEST_SIGNATURE, 0).decode(errors="replace") or "another process"
        raise AlreadyHeld(f"{what} is held by {holder}: end that first, or use another one") from error
