"""A whole run in one plain file, to be given away: the paths of ``run.h5``, no view, no second file."""

import shutil
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from daq.errors import DiskFull, RecorderError
from daq.files.atomic_file import replacing
from daq.files.columns import columns_of, frames_path
from daq.files.header import RunHeader
from daq.files.later_notes import document_of, read_changes
from daq.files.references_file import require_references
from daq.files.run_file import RUN_FILE, reading, shot_path, write_later_notes
from daq.files.shot_file import LIBRARY_VERSIONS, create_frames, read_shot_of, reading_shot
from daq.files.storage import storing


def pack_run(run_dir: Path, header: RunHeader, shot_count: int, out: Path) -> None:
    """Write ``out``; compressed frames are copied as they are.

    Raises
    ------
    ShotFileError
        A shot cannot be read, or its later notes, or a reference is not what was written: a packed run is complete or
        not there, and other programs compare no checksums.
    StorageError
        The disk of ``out`` refuses, or has no room for the run.
    """
    _require_room(run_dir, shot_count, out.parent)
    require_references(run_dir, header)
    changes = read_changes(run_dir, header)
    with storing(out.parent), replacing(out) as part:
        shutil.copyfile(run_dir / RUN_FILE, part)
        with h5py.File(part, "r+", libver=LIBRARY_VERSIONS) as packed:
            _replace_view(packed, header, shot_count)
            if changes:
                write_later_notes(packed, document_of(header, changes))
            for index in range(shot_count):
                _copy_shot(shot_path(run_dir, index), header, index, packed)


def holds_its_shots(run_dir: Path) -> bool:
    """Whether ``run.h5`` is a packed file, which holds the shots itself; ShotFileError if it cannot be read."""
    with reading(run_dir) as file:
        frames = [file[frames_path(view)] for view in file["cameras"]]
        return any(stored.shape[0] and not stored.is_virtual for stored in frames)


def require_free(out: Path) -> None:
    """Raise RecorderError if ``out`` exists."""
    if out.exists():
        raise RecorderError(f"{out}: exists already, it is not overwritten")


def _require_room(run_dir: Path, shot_count: int, folder: Path) -> None:
    """Before anything is written: HDF5 may crash where the disk is full when a file is closed."""
    files = [run_dir / RUN_FILE, *(shot_path(run_dir, index) for index in range(shot_count))]
    needed = sum(file.stat().st_size for file in files if file.exists())
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise DiskFull(
            f"the disk of {folder} has {free} bytes left, and the packed run takes up to {needed} bytes: "
            "delete or move away what is not needed, or name a file on another disk"
        )


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
    read_shot_of(path, header, index)
    columns, chunks = _read_as_it_is(path, header)
    for name, value in columns.items():
        packed[name][index] = value
    for (view, number), chunk in chunks.items():
        packed[frames_path(view)].id.write_direct_chunk((index, number, 0, 0), chunk)


def _read_as_it_is(path: Path, header: RunHeader) -> tuple[dict[str, Any], dict[tuple[str, int], bytes]]:
    """Columns by name, compressed frames by view and number; all of it before anything is written.

    So a disk that takes nothing is not taken for a shot that cannot be read.
    """
    numbers = range(header.frames_per_shot)
    with reading_shot(path, header) as shot:
        columns = {name: shot[name][0] for name in columns_of(header, shot.attrs["schema_version"])}
        frames = {view: shot[frames_path(view)].id for view in header.views}
        chunks = {(view, n): frames[view].read_direct_chunk((0, n, 0, 0))[1] for view in header.views for n in numbers}
    return columns, chunks
