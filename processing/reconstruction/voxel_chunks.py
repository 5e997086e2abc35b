"""Slabs as the chunks of a volume file: the bytes that HDF5's own gzip filter would make of them.

They are not shuffled: most of a spray is zeros, of which long runs deflate faster than those of single bytes do, and to
no more. Of numbers of float32 nothing but zeros gets shorter: where that is so, they are taken out, and the rest is
stored as it is, which takes a third of the time.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from functools import partial
from typing import Any

import cv2
import numpy as np
from isal import isal_zlib
from numpy.typing import NDArray

from processing.kernels import _native

PLANES_AT_ONCE = 32
"""One thread turns so many planes into chunks at a time."""
_LEVEL = 1
_LONGER = 1.35
"""Chunks of which only zeros are taken out may have so many times the bytes of those that are deflated."""
Pack = Callable[[NDArray[Any]], bytes]


def chunks_of(
    slab: NDArray[Any], chunk_shape: tuple[int, int], dtype: np.dtype[Any], unit: float, pool: Executor
) -> Iterator[bytes]:
    """One chunk per plane z, in order; beyond the slab it is zero.

    Parameters
    ----------
    slab : (nz, rows, nx) float32, float16 or uint8 array
        Its memory is read until the last chunk has come.
    chunk_shape : tuple[int, int]
        (rows, nx), rows as many as the slab has, or more.
    dtype : dtype
        float32, or uint8 where the slab has it.
    unit : float
        Voxels of float32 are multiplied by it.
    pool : Executor
        Threads that work side by side.
    """
    parts = [slab[z : z + PLANES_AT_ONCE] for z in range(0, len(slab), PLANES_AT_ONCE)]
    for chunks in pool.map(partial(_chunks, chunk_shape, dtype, unit), parts):
        yield from chunks


def _chunks(chunk_shape: tuple[int, int], dtype: np.dtype[Any], unit: float, planes: NDArray[Any]) -> list[bytes]:
    pack = _quicker(planes[len(planes) // 2]) if planes.dtype == np.float32 else _deflate
    return [pack(chunk) for chunk in _whole(chunk_shape, dtype, unit, planes)]


def _whole(
    chunk_shape: tuple[int, int], dtype: np.dtype[Any], unit: float, planes: NDArray[Any]
) -> Iterator[NDArray[Any]]:
    """Planes as they are stored; the memory of one may be that of the one before."""
    if planes.dtype == dtype and planes.shape[1:] == chunk_shape and (unit == 1 or dtype != np.float32):
        yield from map(np.ascontiguousarray, planes)
        return
    chunk = np.zeros(chunk_shape, dtype)
    for rows in planes:
        _copy(rows, chunk[: len(rows)])
        if dtype == np.float32 and unit != 1:
            chunk *= np.float32(unit)
        yield chunk


def _quicker(sample: NDArray[Any]) -> Pack:
    """How chunks like this one are packed."""
    rows = np.ascontiguousarray(sample)
    return _take_out_zeros if len(_take_out_zeros(rows)) < _LONGER * len(_deflate(rows)) else _deflate


def _deflate(rows: NDArray[Any]) -> bytes:
    return isal_zlib.compress(rows, _LEVEL)


def _take_out_zeros(rows: NDArray[Any]) -> bytes:
    return _native.pack_zero_runs(rows, isal_zlib.adler32(rows))


def _copy(rows: NDArray[Any], to: NDArray[Any]) -> None:
    """OpenCV makes float32 of float16 seven times faster than numpy does."""
    if rows.dtype == np.float16 and to.dtype == np.float32:
        cv2.convertFp16(rows.view(np.int16), to)
    else:
        to[:] = rows
