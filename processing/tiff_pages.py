"""Where the pages of a TIFF lie, and how one of them is decoded as it was stored.

OpenCV decodes the first page, and turns it as its orientation tag says. So the header is made to point at another page,
and the tag is set to 1: no turn. TIFF 6.0, section 2; BigTIFF (libtiff.gitlab.io, BigTIFF design) has wider fields.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Content = NDArray[np.uint8]

ORIENTATION_TAG, SHORT, AS_STORED = 274, 3, 1
COMPRESSION_TAG, DEFLATE = 259, (8, 32946)
SUBFILE_TAG, PREVIEW = 254, 1
BITS_TAG, PHOTOMETRIC_TAG, WHITE_IS_ZERO = 258, 262, 0
PLANES_TAG, SEPARATE = 284, 2
DESCRIPTION_TAG, DEPTH_TAG = 270, 32997
_IMAGEJ = re.compile(rb"ImageJ=.*?\bimages=(\d+)", re.DOTALL)
"""As ImageJ describes a stack, of which it lists only the first image where the file is larger than 4 GB."""
PART_TAGS = {273: 279, 324: 325}
"""Where strips, or tiles, begin: and how many bytes they have."""
_WIDTHS = {SHORT: 2, 4: 4, 16: 8}
"""In bytes, of the types SHORT, LONG and LONG8."""


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


@dataclass(frozen=True)
class PageKind:
    """What the fields of a page say of its pixels.

    Parameters
    ----------
    bits : int
        Of a sample.
    white_is_zero : bool
        Whether larger values are darker.
    is_preview : bool
        Whether it is a smaller version of an image that lies elsewhere in the file, as raw files of cameras have.
    has_planes : bool
        Whether red, green and blue lie apart.
    described : int
        How many images it says the file holds, or the page itself in its depth; 1 where it says nothing.
    """

    bits: int
    white_is_zero: bool
    is_preview: bool
    has_planes: bool
    described: int


def page_offsets(content: Content) -> tuple[int, ...]:
    """Where the directory of every page begins; empty where the bytes are no TIFF.

    Raises
    ------
    ValueError
        There are more pages, beyond the end of the file.
    """
    layout = _LAYOUTS.get(content[:4].tobytes())
    return tuple(_offsets(content, layout)) if layout else ()


def show_page(content: Content, offset: int) -> None:
    """Change the bytes of a TIFF so that the page at an offset is the first one, and is not turned."""
    layout = _LAYOUTS[content[:4].tobytes()]
    _write(content, layout.first, layout.offset, layout, offset)
    for tag, kind, entry in _entries(content, offset, layout):
        if (tag, kind) == (ORIENTATION_TAG, SHORT):
            _write(content, entry + layout.value, 2, layout, AS_STORED)


def deflated_parts(content: Content, offset: int) -> Iterator[Content]:
    """The strips or tiles of the page at an offset if they are zlib streams, of which libtiff reads no checksum."""
    layout = _LAYOUTS[content[:4].tobytes()]
    fields = {tag: (kind, entry) for tag, kind, entry in _entries(content, offset, layout)}
    values = {tag: _values(content, *fields[tag], layout) for tag in (COMPRESSION_TAG, *PART_TAGS) if tag in fields}
    if not {*values.get(COMPRESSION_TAG, ())} & {*DEFLATE}:
        return
    for begin, length in PART_TAGS.items():
        if begin in fields and length in fields:
            for first, size in zip(values[begin], _values(content, *fields[length], layout), strict=False):
                yield content[first : first + size]


def page_kind(content: Content, offset: int) -> PageKind:
    """What the page at an offset says of its pixels."""
    layout = _LAYOUTS[content[:4].tobytes()]
    fields = {tag: (kind, entry) for tag, kind, entry in _entries(content, offset, layout)}

    def first(tag: int, default: int) -> int:
        return next(iter(_values(content, *fields[tag], layout)), default) if tag in fields else default

    return PageKind(
        bits=first(BITS_TAG, 1),
        white_is_zero=first(PHOTOMETRIC_TAG, WHITE_IS_ZERO + 1) == WHITE_IS_ZERO,
        is_preview=bool(first(SUBFILE_TAG, 0) & PREVIEW),
        has_planes=first(PLANES_TAG, 1) == SEPARATE,
        described=max(first(DEPTH_TAG, 1), _described(content, fields.get(DESCRIPTION_TAG), layout)),
    )


def _described(content: Content, field: tuple[int, int] | None, layout: _Layout) -> int:
    """How many images a description by ImageJ speaks of; 1 of any other."""
    if field is None:
        return 1
    _, entry = field
    start = _number(content, entry + layout.value, layout.offset, layout)
    text = content[start : start + _number(content, entry + 4, layout.value - 4, layout)].tobytes()
    match = _IMAGEJ.match(text)
    return int(match[1]) if match else 1


def _entries(content: Content, offset: int, layout: _Layout) -> Iterator[tuple[int, int, int]]:
    """Tag, type and place of every entry of a directory."""
    for number in range(min(_number(content, offset, layout.count, layout), content.size // layout.entry)):
        entry = offset + layout.count + number * layout.entry
        yield _number(content, entry, 2, layout), _number(content, entry + 2, 2, layout), entry


def _values(content: Content, kind: int, entry: int, layout: _Layout) -> list[int]:
    """Unsigned numbers of an entry, which stand in it, or elsewhere if they are many."""
    width = _WIDTHS.get(kind, layout.offset)
    count = min(_number(content, entry + 4, layout.value - 4, layout), content.size // width)
    inside = count * width <= layout.entry - layout.value
    start = entry + layout.value if inside else _number(content, entry + layout.value, layout.offset, layout)
    return [_number(content, start + number * width, width, layout) for number in range(count)]


def _offsets(content: Content, layout: _Layout) -> Iterator[int]:
    """Follow the chain of directories, to its end, or until it runs in a circle."""
    seen: set[int] = set()
    offset = _number(content, layout.first, layout.offset, layout)
    while offset and offset not in seen:
        entries = _number(content, offset, layout.count, layout)
        end = offset + layout.count + entries * layout.entry
        if seen and (not entries or end + layout.offset > content.size):
            raise ValueError(f"holds more than {len(seen)} images, which lie beyond its end: was it cut?")
        if not entries:
            return
        seen.add(offset)
        yield offset
        offset = _number(content, end, layout.offset, layout)


def _number(content: Content, start: int, width: int, layout: _Layout) -> int:
    """An unsigned number; 0 beyond the end."""
    field = content[start : start + width]
    return int.from_bytes(field.tobytes(), layout.order) if field.size == width else 0


def _write(content: Content, start: int, width: int, layout: _Layout, value: int) -> None:
    content[start : start + width] = np.frombuffer(value.to_bytes(width, layout.order), np.uint8)
