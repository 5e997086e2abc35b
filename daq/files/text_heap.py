"""Heaps of texts in HDF5 files: HDF5 gives them no checksum, and reads one whose chain is broken for ever.

A heap begins with its signature, version and size; then come its objects, each with number, length and content, and
last, with number 0, the free space (HDF5 File Format Specification, III.E, "Global Heap").
"""

from functools import lru_cache
from pathlib import Path

_BEGIN = b"GCOL\x01\x00\x00\x00"
_HEAD = 16
"""Bytes before the first object, and before the content of each."""


def has_whole_heaps(path: Path) -> bool:
    """Whether every heap of texts in a file can be read to its end; OSError if the file cannot be read."""
    status = path.stat()
    return _has_whole_heaps(path, status.st_mtime_ns, status.st_size, status.st_ino)


@lru_cache(maxsize=256)
def _has_whole_heaps(path: Path, _mtime_ns: int, _size: int, _inode: int) -> bool:
    content = path.read_bytes()  # not mapped: a disk that fails would end the process instead of raising
    start = content.find(_BEGIN)
    while start >= 0:
        if not _is_whole(content, start):
            return False
        start = content.find(_BEGIN, start + _HEAD)
    return True


def _is_whole(content: bytes, start: int) -> bool:
    """Whether the objects of a heap fill it."""
    end, at = start + _number(content, start + 8, 8), start + _HEAD
    if not at <= end <= len(content):
        return False
    while at + _HEAD <= end:
        length = _number(content, at + 8, 8)
        if _number(content, at, 2) == 0:
            return at + length == end
        at += _HEAD + -(-length // 8) * 8
    return at <= end


def _number(content: bytes, at: int, size: int) -> int:
    return int.from_bytes(content[at : at + size], "little")
