"""Chunks of volumes are ordinary zlib streams; numbers that deflate does not shorten are stored as they are."""

import zlib
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from isal import isal_zlib
from numpy.typing import NDArray

from processing.kernels import _native
from processing.reconstruction.voxel_chunks import chunks_of

Floats = NDArray[np.float32]
MANY = 2 * 65535 // 4 + 3
"""Numbers that take more than two stored blocks."""


def packed(numbers: Floats) -> bytes:
    return _native.pack_zero_runs(numbers, isal_zlib.adler32(numbers))


def chunks(volume: NDArray[np.float32]) -> list[bytes]:
    with ThreadPoolExecutor(1) as pool:
        return list(chunks_of(volume, volume.shape[1:], np.dtype(np.float32), 1.0, pool))


def sparse(rows: int = 64, columns: int = 300, filled: int = 100) -> Floats:
    numbers = np.zeros((1, rows, columns), np.float32)
    numbers[..., :filled] = np.random.default_rng(1).random((1, rows, filled))
    return numbers


@settings(max_examples=60)
@given(st.lists(st.tuples(st.integers(0, 70), st.integers(0, 300)), max_size=12))
def test_runs_of_any_length_come_back(spans: list[tuple[int, int]]) -> None:
    numbers = np.concatenate([[1], *(np.repeat([1.5, 0], span) for span in spans)])[None].astype(np.float32)
    assert zlib.decompress(packed(numbers)) == numbers.tobytes()


def test_a_run_of_zeros_takes_hardly_any_bytes() -> None:
    for zeros in range(8, 140):
        numbers = np.zeros((1, zeros), np.float32)
        assert zlib.decompress(packed(numbers)) == numbers.tobytes(), zeros
        assert len(packed(numbers)) <= 18, zeros


@pytest.mark.parametrize("numbers", [1, MANY])
def test_what_has_no_zeros_is_stored_as_it_is(numbers: int) -> None:
    some = np.random.default_rng(2).random((1, numbers), np.float32) + 1
    assert zlib.decompress(packed(some)) == some.tobytes()
    assert len(packed(some)) - some.nbytes < 16 + 5 * 3


def test_other_bits_than_those_of_zero_are_no_zeros() -> None:
    numbers = np.tile(np.array([-0.0, 1e-45], np.float32), (1, 20))
    assert zlib.decompress(packed(numbers)) == numbers.tobytes()


def test_numbers_that_deflate_does_not_shorten_lie_in_the_chunk_as_they_are() -> None:
    volume = sparse()
    (chunk,) = chunks(volume)
    assert zlib.decompress(chunk) == volume.tobytes()
    assert volume[0, 7, :100].tobytes() in chunk


def test_numbers_that_deflate_shortens_are_deflated() -> None:
    volume = (sparse() > 0.5).astype(np.float32)
    (chunk,) = chunks(volume)
    assert zlib.decompress(chunk) == volume.tobytes()
    assert len(chunk) < 0.05 * volume.nbytes
