"""What a disk refuses, told to operators: which path, how much is free, what to do. No numbers of the system."""

import errno
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from daq.errors import DiskForbidden, DiskFull, DiskGone, DiskReadOnly, StorageError

_KINDS: dict[int, type[StorageError]] = {
    **dict.fromkeys((errno.ENOSPC, errno.EDQUOT, errno.EFBIG), DiskFull),
    **dict.fromkeys((errno.EROFS,), DiskReadOnly),
    **dict.fromkeys((errno.EACCES, errno.EPERM), DiskForbidden),
    **dict.fromkeys((errno.ENOENT, errno.ENOTDIR, errno.ESTALE, errno.ENODEV, errno.ENXIO, errno.ENOTCONN), DiskGone),
}
_HDF5_ERRNO = re.compile(r"errno = (\d+)")


@contextmanager
def storing(path: Path) -> Iterator[None]:
    """Let a block write to a folder, and turn what the disk refuses into StorageError.

    Parameters
    ----------
    path : Path
        The folder that the operator knows; named by the error.
    """
    try:
        yield
    except (OSError, RuntimeError) as error:
        number = _errno_of(error)
        if number is None:
            raise
        raise _explained(number, path) from error


def require_room(path: Path, needed_bytes: int, margin_bytes: int) -> None:
    """Refuse to write so many bytes if less than the margin were free afterwards.

    Raises
    ------
    DiskFull
        Names path, free bytes, and what to do.
    """
    free = shutil.disk_usage(path).free
    if margin_bytes and free - needed_bytes < margin_bytes:
        raise DiskFull(
            f"the disk of {path} has {free} bytes left, and a run leaves {margin_bytes} bytes free: "
            "delete or move away what is not needed, then start again"
        )


def folder_number(path: Path) -> tuple[int, int] | None:
    """Number of the disk that a folder lies on, and its own there; None if there is no such folder."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino


def _errno_of(error: OSError | RuntimeError) -> int | None:
    """Number of the system's error; HDF5 hides it in its text where it fails to close a file."""
    if isinstance(error, OSError) and error.errno is not None:
        return error.errno
    hidden = _HDF5_ERRNO.search(str(error))
    return int(hidden[1]) if hidden else None


def _explained(number: int, path: Path) -> StorageError:
    kind = _KINDS.get(number, StorageError)
    told = {
        DiskFull: f"the disk of {path} is full ({_free(path)}): delete or move away what is not needed",
        DiskReadOnly: f"the disk of {path} is read-only, as after a fault of it: look at it, mount it for writing",
        DiskForbidden: f"{path} may not be written by this server (user {os.getuid()}): give the permission back",
        DiskGone: f"{path} is gone (moved, deleted, or its disk is not mounted): bring it back",
        StorageError: f"the disk of {path} takes no data ({os.strerror(number).lower()}): look at it, use another one",
    }
    return kind(f"{told[kind]}, then start again")


def _free(path: Path) -> str:
    try:
        return f"{shutil.disk_usage(path).free} bytes are free"
    except OSError:
        return "nobody knows how much is free"
