"""Reading images from elsewhere: any format OpenCV knows by its content, 8 to 16 bit, as grey values.

Rows and columns are those of the file: tags that ask a viewer to turn an image are ignored in every format, as cameras
are calibrated by the pixels of their sensors.
"""

import os
import re
import threading
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.grey_colours import ImageFileError as ImageFileError
from processing.grey_colours import grey_of_colours
from processing.tiff_pages import PageKind, deflated_parts, page_kind, page_offsets, show_page

GreyImage = NDArray[np.uint8] | NDArray[np.uint16]
T = TypeVar("T")
_STDERR = threading.Lock()
_BLANK = rb"(?:\s|#[^\n]*\n)+"
_NETPBM = re.compile(rb"P([56])" + 3 * (_BLANK + rb"(\d+)") + rb"\s")
_PAM, _PAM_FIELD = re.compile(rb"P7\n(.*?)ENDHDR\n", re.DOTALL), re.compile(rb"^(\w+)\s+(\w+)\s*$", re.MULTILINE)
_JPEG_SEGMENT, _JPEG_PIXELS, _MPO = 0xFF, 0xDA, b"MPF\0"
"""Before a segment, the one of the pixels; how one begins that lists further images (CIPA DC-007)."""
_SUN_RASTER = b"\x59\xa6\x6a\x95"
"""Of whose images OpenCV makes zeros, or other grey values."""


def read_image(path: Path, page: int | None = None) -> GreyImage:
    """Grey values (row, column), uint8 or uint16. Colours that are grey become it; the file's name does not matter.

    Parameters
    ----------
    path : Path
        Image file.
    page : int, optional
        Which image of a stack, counted from 0.

    Raises
    ------
    ImageFileError
        The file is missing, is not such an image, has no such page, or holds several and nobody said which.
    """
    content = _content(path)
    offsets = _pages(path, content)
    chosen = _chosen_page(path, page, len(offsets) or 1)
    if offsets:
        show_page(content, offsets[chosen])
        _check_parts(path, deflated_parts(content, offsets[chosen]))
    image, complaints = _heard(lambda: _decoded(content)) if _is_jpeg(content) else (_decoded(content), "")
    if image is None or content[:4].tobytes() == _SUN_RASTER:
        raise ImageFileError(f"{path}: not an image that is read right: convert it to PNG or TIFF")
    if complaints:
        raise ImageFileError(f"{path}: is damaged: {complaints}")
    if offsets:
        _check_kind(path, page_kind(content, offsets[chosen]), image.dtype)
    if image.ndim == 3:
        image = grey_of_colours(path, image)
    if image.dtype == np.uint8:
        return np.asarray(image, dtype=np.uint8)
    if image.dtype == np.uint16:
        return np.asarray(image, dtype=np.uint16)
    raise ImageFileError(f"{path}: grey values of type {image.dtype}, integers of 8 to 16 bit are needed")


def page_count(path: Path) -> int:
    """How many images a file holds.

    Raises
    ------
    ImageFileError
        It cannot be opened, or is an animation.
    """
    return len(_pages(path, _content(path))) or 1


def _pages(path: Path, content: NDArray[np.uint8]) -> tuple[int, ...]:
    """Where the pages of a TIFF begin; empty for every other image, of which OpenCV reads the first one alone."""
    try:
        offsets = page_offsets(content)
    except ValueError as error:
        raise ImageFileError(f"{path}: {error}") from error
    if offsets and (described := page_kind(content, offsets[0]).described) > len(offsets):
        raise ImageFileError(f"{path}: holds {described} images, and lists {len(offsets)}; save them one by one")
    if _is_netpbm_stack(content):
        raise ImageFileError(f"{path}: holds several images, one after the other; of all formats only TIFF may do so")
    if content[:2].tobytes() == b"P7" and not _is_grey_pam(content):
        raise ImageFileError(f"{path}: of PAM files only those with one image of GRAYSCALE are read right: convert it")
    if _is_jpeg(content) and _lists_images(content):
        raise ImageFileError(f"{path}: holds several images, as MPO; of all formats only TIFF may do so")
    if not offsets and (count := cv2.imcount(str(path), cv2.IMREAD_UNCHANGED)) > 1:
        raise ImageFileError(f"{path}: is an animation of {count} images; of all formats only TIFF may hold several")
    return offsets


def _is_netpbm_stack(content: NDArray[np.uint8]) -> bool:
    """Whether another image begins where a PGM or PPM ends, which OpenCV does not count."""
    header = _NETPBM.match(content[:1024].tobytes())
    if header is None:
        return False
    columns, rows, brightest = map(int, header.groups()[1:])
    pixel = (3 if header[1] == b"6" else 1) * (2 if brightest > np.iinfo(np.uint8).max else 1)
    after = header.end() + columns * rows * pixel
    return bool(_NETPBM.match(content[after : after + 1024].tobytes()))


def _is_grey_pam(content: NDArray[np.uint8]) -> bool:
    """Whether a PAM is one grey image: of others OpenCV takes red for blue, or leaves out what follows."""
    header = _PAM.match(content[:1024].tobytes())
    fields = dict(_PAM_FIELD.findall(header[1])) if header else {}
    try:
        columns, rows, depth, brightest = (int(fields[name]) for name in (b"WIDTH", b"HEIGHT", b"DEPTH", b"MAXVAL"))
    except (KeyError, ValueError):
        return False
    size = columns * rows * (2 if brightest > np.iinfo(np.uint8).max else 1)
    whole = header is not None and content.size == header.end() + size
    return whole and (fields.get(b"TUPLTYPE"), depth) == (b"GRAYSCALE", 1)


def _lists_images(content: NDArray[np.uint8]) -> bool:
    """Whether a segment before the pixels of a JPEG says that there are images after them."""
    start = 2
    while start + 4 <= content.size and content[start] == _JPEG_SEGMENT and content[start + 1] != _JPEG_PIXELS:
        if content[start + 4 : start + 8].tobytes() == _MPO:
            return True
        start += 2 + int.from_bytes(content[start + 2 : start + 4].tobytes(), "big")
    return False


def _decoded(content: NDArray[np.uint8]) -> NDArray[Any] | None:
    try:
        return cv2.imdecode(content, cv2.IMREAD_UNCHANGED) if content.size else None
    except cv2.error:
        return None


def _check_parts(path: Path, parts: Iterable[NDArray[np.uint8]]) -> None:
    """Pixels that were compressed by zlib have a checksum; who stops at the last pixel does not read it."""
    for part in parts:
        try:
            zlib.decompress(part.tobytes())
        except zlib.error as error:
            raise ImageFileError(f"{path}: is damaged: {error}") from error


def _check_kind(path: Path, kind: PageKind, decoded: np.dtype[Any]) -> None:
    """Refuse a page that OpenCV decodes otherwise than it is meant, without a word."""
    if kind.is_preview:
        raise ImageFileError(f"{path}: holds a preview of an image in the sensor's own format; save it as a plain TIFF")
    if kind.bits > 8 and decoded == np.uint8:
        raise ImageFileError(f"{path}: has {kind.bits} bits, of which only 8 can be read; save it as a grey image")
    if kind.has_planes and decoded == np.uint16:
        raise ImageFileError(f"{path}: holds colours of 16 bits in separate planes; save it as a grey image")
    if kind.white_is_zero and decoded == np.uint16:
        raise ImageFileError(f"{path}: counts light from white, 0, to black (WhiteIsZero); save it with black as 0")


def _is_jpeg(content: NDArray[np.uint8]) -> bool:
    return content[:2].tobytes() == b"\xff\xd8"


def _heard(decode: Callable[[], T]) -> tuple[T, str]:
    """What is decoded, and what libjpeg says of it on the stderr of the process: it has no other way to complain."""
    with _STDERR, TemporaryFile() as said:
        stderr = os.dup(2)
        os.dup2(said.fileno(), 2)
        try:
            decoded = decode()
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
        said.seek(0)
        return decoded, said.read().decode(errors="replace").strip()


def _content(path: Path) -> NDArray[np.uint8]:
    """Bytes of a file, which may be changed in memory; of a large stack only what is looked at is read."""
    try:
        if not path.stat().st_size:
            return np.empty(0, np.uint8)
        return np.asarray(np.memmap(path, np.uint8, mode="c"))
    except OSError as error:
        raise ImageFileError(f"{path}: {error.strerror}") from error


def _chosen_page(path: Path, page: int | None, count: int) -> int:
    if page is None and count > 1:
        raise ImageFileError(f"{path}: holds {count} images; say by page = 0 to {count - 1} which one is meant")
    if (page or 0) >= count:
        raise ImageFileError(f"{path}: has no page {page}, it holds {count} images, the first one is page 0")
    return page or 0
