"""Files that appear complete or not at all: write beside, fsync, rename, fsync the folder.

A file that must be changed on a full disk has a reserve beside it: blocks that its changed copy is written into.
"""

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PART_SUFFIX = ".part"
RESERVE_SUFFIX = ".reserve"


def part_path(path: Path) -> Path:
    """Where a file is written before it is committed; readers ignore such files."""
    return path.with_name(path.name + PART_SUFFIX)


def own_part_path(path: Path) -> Path:
    """A part that nobody else writes, where several may write one file at a time, on this computer or another."""
    return part_path(path.with_name(f"{path.name}.{secrets.token_hex(4)}"))


def reserve_path(path: Path) -> Path:
    """Where room for a changed copy of a file is kept."""
    return path.with_name(path.name + RESERVE_SUFFIX)


def reserve(path: Path, more_bytes: int) -> None:
    """Take room on the disk for a copy of a file, which need not be there yet, that is longer by some bytes."""
    size_bytes = path.stat().st_size if path.exists() else 0
    descriptor = os.open(reserve_path(path), os.O_RDWR | os.O_CREAT, 0o666)
    try:
        os.posix_fallocate(descriptor, 0, size_bytes + more_bytes)
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def sync(path: Path) -> None:
    """Wait until a file or a folder is on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def commit(part: Path, path: Path) -> None:
    """Give a synced part its final name; from here on it survives a power cut."""
    part.rename(path)
    sync(path.parent)


@contextmanager
def replacing(path: Path, part: Path | None = None) -> Iterator[Path]:
    """Yield the path of a part that replaces ``path`` at the end, or vanishes if the block raises.

    Parameters
    ----------
    path : Path
        The file.
    part : Path | None
        By default ``part_path``.

    Raises
    ------
    OSError
        The disk is full, say; it names the file.
    """
    part = part or part_path(path)
    try:
        yield part
        sync(part)
    except OSError as error:
        part.unlink(missing_ok=True)
        if error.errno is None or error.filename is not None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    commit(part, path)


@contextmanager
def amending(path: Path) -> Iterator[Path]:
    """Yield the path of a copy of a file that replaces it at the end."""
    with replacing(path) as part:
        shutil.copyfile(path, part)
        yield part


@contextmanager
def spending_reserve(path: Path) -> Iterator[Path]:
    """Like ``amending``, but the copy lies in the reserve, if there is one: it needs no room on the disk.

    A reserve outlives a block that raises, so that the same change can be tried again.
    """
    copy = reserve_path(path)
    if not copy.exists():
        with amending(path) as part:
            yield part
        return
    with copy.open("r+b") as reserved:  # never truncated: a full disk would not give its blocks back
        reserved.write(path.read_bytes())
    yield copy
    sync(copy)
    commit(copy, path)
