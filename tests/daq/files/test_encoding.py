"""Frames as bytes: HDF5's own filters read what is encoded, and what they write is decoded."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from daq.files.encoding import EncodedFrame, decode_frame, encode_frame, inflate

DTYPES = [np.dtype(name) for name in ("<u1", "<u2", "<f4", "<f8")]


def frame_of(dtype: np.dtype) -> np.ndarray:
    return np.random.default_rng(1).integers(0, 256, (7, 9 * dtype.itemsize), np.uint8).view(dtype)


@pytest.mark.parametrize("dtype", DTYPES, ids=str)
def test_hdf5_reads_what_is_encoded_and_what_it_writes_is_decoded(tmp_path: Path, dtype: np.dtype) -> None:
    frame, filters = frame_of(dtype), {"compression": "gzip", "compression_opts": 1, "shuffle": dtype.itemsize > 1}
    with h5py.File(tmp_path / "frames.h5", "w") as file:
        theirs = file.create_dataset("theirs", data=frame, chunks=frame.shape, **filters)
        ours = file.create_dataset("ours", frame.shape, dtype, chunks=frame.shape, **filters)
        ours.id.write_direct_chunk((0, 0), encode_frame(frame).chunk)
        assert ours[()].tobytes() == frame.tobytes()
        chunk = theirs.id.read_direct_chunk((0, 0))[1]
    assert inflate(chunk, frame.shape, dtype).tobytes() == frame.tobytes()


@pytest.mark.parametrize("dtype", DTYPES, ids=str)
def test_a_frame_of_another_checksum_is_damaged(dtype: np.dtype) -> None:
    frame = frame_of(dtype)
    encoded = encode_frame(frame)
    assert decode_frame(encoded, frame.shape, dtype).tobytes() == frame.tobytes()
    with pytest.raises(ValueError, match="CRC-32 differs"):
        decode_frame(EncodedFrame(encoded.chunk, encoded.crc32 ^ 1), frame.shape, dtype)
