"""Files that appear complete or not at all: write beside, fsync, rename, fsync the folder."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PART_SUFFIX = ".part"


def part_path(path: Path) -> Path:
    """Where a file is written before it is committed; readers ignore such files."""
    return path.with_name(path.name + PART_SUFFIX)


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
def replacing(path: Path) -> Iterator[Path]:
    """Yield the path of a part that replaces ``path`` at the end, or vanishes if the block raises.

    Raises
    ------
    OSError
        The disk is full, say; it names the file.
    """
    part = part_path(path)
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
