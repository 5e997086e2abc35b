"""Where the pages of a TIFF lie, and how one of them is decoded as it was stored.

OpenCV decodes the first page, and turns it as its orientation tag says. So the header is made to point at another page,
and the tag is set to 1: no turn. TIFF 6.0, section 2; BigTIFF (libtiff.gitlab.io, BigTIFF design) has wider fields.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Content = NDArray[np.uint8]

ORIENTATION_TAG, SHORT, AS_STORED = 274, 3, 1


@dataclass(frozen=True)
class _Layout:
    """Byte order; where the first offset stands; widths in bytes of offset, count and entry; a value in its entry."""

    order: Literal["big", "little"]
    first: int
    offset: int
    count: int
    entry: int
    value: int


_LAYOUTS = {
    b"II*\0": _Layout("little", first=4, offset=4, count=2, entry=12, value=8),
    b"MM\0*": _Layout("big", first=4, offset=4, count=2, entry=12, value=8),
    b"II+\0": _Layout("little", first=8, offset=8, count=8, entry=20, value=12),
    b"MM\0+": _Layout("big", first=8, offset=8, count=8, entry=20, value=12),
}


def page_offsets(content: Content) -> tuple[int, ...]:
    """Where the directory of every page begins; empty where the bytes are no TIFF."""
    layout = _LAYOUTS.get(content[:4].tobytes())
    return tuple(_offsets(content, layout)) if layout else ()


def show_page(content: Content, offset: int) -> None:
    """Change the bytes of a TIFF so that the page at an offset is the first one, and is not turned."""
    layout = _LAYOUTS[content[:4].tobytes()]
    _write(content, layout.first, layout.offset, layout, offset)
    entries = min(_number(content, offset, layout.count, layout), content.size // layout.entry)
    for number in range(entries):
        entry = offset + layout.count + number * layout.entry
        tag, kind = (_number(content, start, 2, layout) for start in (entry, entry + 2))
        if (tag, kind) == (ORIENTATION_TAG, SHORT):
            _write(content, entry + layout.value, 2, layout, AS_STORED)


def _offsets(content: Content, layout: _Layout) -> Iterator[int]:
    """Follow the chain of directories, to its end, to that of a torn file, or until it runs in a circle."""
    seen: set[int] = set()
    offset = _number(content, layout.first, layout.offset, layout)
    while offset and offset not in seen and (entries := _number(content, offset, layout.count, layout)):
        seen.add(offset)
        yield offset
        offset = _number(content, offset + layout.count + entries * layout.entry, layout.offset, layout)


def _number(content: Content, start: int, width: int, layout: _Layout) -> int:
    """An unsigned number; 0 beyond the end."""
    field = content[start : start + width]
    return int.from_bytes(field.tobytes(), layout.order) if field.size == width else 0


def _write(content: Content, start: int, width: int, layout: _Layout, value: int) -> None:
    content[start : start + width] = np.frombuffer(value.to_bytes(width, layout.order), np.uint8)
