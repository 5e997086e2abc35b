"""Maxima of blocks of a volume, slab after slab: those that numpy finds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import DTypeLike, NDArray

from processing.kernels import _native

SHAPES = st.tuples(st.integers(1, 20), st.integers(1, 20), st.integers(1, 40))
DTYPES = st.sampled_from([np.float32, np.float16, np.uint8])


def volume_of(shape: tuple[int, int, int], dtype: DTypeLike) -> NDArray[np.float32]:
    return (np.random.default_rng(1).random(shape) * 200).astype(dtype)


def empty_maxima(volume: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    return np.zeros([-(-size // factor) for size in volume.shape], volume.dtype)


@given(SHAPES, DTYPES, st.integers(1, 7), st.integers(1, 20), st.integers(1, 3))
def test_they_are_those_of_numpy(
    shape: tuple[int, int, int], dtype: DTypeLike, factor: int, rows: int, threads: int
) -> None:
    volume = volume_of(shape, dtype)
    maxima = empty_maxima(volume, factor)
    for first_row in range(0, shape[1], rows):
        _native.add_block_maxima(volume[:, first_row : first_row + rows], first_row, factor, maxima, threads)
    expected = volume
    for axis, size in enumerate(shape):
        expected = np.maximum.reduceat(expected, np.arange(0, size, factor), axis=axis)
    np.testing.assert_array_equal(maxima, expected)


@pytest.mark.parametrize(
    ("rows", "columns", "first_row", "dtype", "said"),
    [
        (slice(0, 6), slice(1, 8), 0, np.float32, "whole rows, side by side"),
        (slice(0, 6, 2), slice(0, 8), 0, np.float32, "whole rows, side by side"),
        (slice(0, 6), slice(0, 8), 1, np.float32, "do not fit the slab"),
        (slice(0, 6), slice(0, 8), -1, np.float32, "out of range"),
        (slice(0, 6), slice(0, 8), 0, np.float16, "of one type"),
    ],
)
def test_what_is_no_slab_of_the_volume_is_refused(
    rows: slice, columns: slice, first_row: int, dtype: DTypeLike, said: str
) -> None:
    volume = volume_of((4, 6, 8), np.float32)
    maxima = empty_maxima(volume, 2).astype(dtype)
    with pytest.raises(ValueError, match=said):
        _native.add_block_maxima(volume[:, rows, columns], first_row, 2, maxima, 1)
