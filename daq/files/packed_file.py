"""A whole run in one plain file, to be given away: the paths of ``run.h5``, no view, no second file."""

import shutil
from pathlib import Path

import h5py
import numpy as np

from daq.errors import RecorderError
from daq.files.atomic_file import replacing
from daq.files.columns import columns_of, frames_path
from daq.files.header import RunHeader
from daq.files.run_file import RUN_FILE, shot_path
from daq.files.shot_file import LIBRARY_VERSIONS, create_frames, is_missing, reading_shot


def pack_run(run_dir: Path, header: RunHeader, shot_count: int, out: Path) -> None:
    """Write ``out``; compressed frames are copied as they are.

    Raises
    ------
    ShotFileError
        A shot cannot be read: a packed run is complete or not there.
    """
    with replacing(out) as part:
        shutil.copyfile(run_dir / RUN_FILE, part)
        with h5py.File(part, "r+", libver=LIBRARY_VERSIONS) as packed:
            _replace_view(packed, header, shot_count)
            for index in range(shot_count):
                _copy_shot(shot_path(run_dir, index), header, index, packed)


def require_free(out: Path) -> None:
    """Raise RecorderError if ``out`` exists."""
    if out.exists():
        raise RecorderError(f"{out}: exists already, it is not overwritten")


def _replace_view(packed: h5py.File, header: RunHeader, shot_count: int) -> None:
    for view, view_format in header.views.items():
        del packed[frames_path(view)]
        create_frames(packed, view, view_format, (shot_count, header.frames_per_shot))
    for path, column in columns_of(header).items():
        if path in packed:
            del packed[path]
        dataset = packed.create_dataset(path, (shot_count, *column.shape), np.dtype(column.dtype))
        dataset.attrs.update(units=column.units, dimensions=column.axes)


def _copy_shot(path: Path, header: RunHeader, index: int, packed: h5py.File) -> None:
    with reading_shot(path, header) as shot:
        for name, column in columns_of(header).items():
            if not is_missing(shot, column):
                packed[name][index] = shot[name][0]
        for view in header.views:
            source, target = shot[frames_path(view)].id, packed[frames_path(view)].id
            for number in range(header.frames_per_shot):
                target.write_direct_chunk((index, number, 0, 0), source.read_direct_chunk((0, number, 0, 0))[1])
