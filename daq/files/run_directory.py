"""The data contract: runs on disk. What ``processing`` needs of ``daq`` it imports from here.

::

    RUN/run.h5          what the run is, its references, its outcome, a view over all shots   (daq.files.run_file)
    RUN/shots/N.h5      one shot, committed by rename after fsync                             (daq.files.shot_file)

Any HDF5 reader sees the whole run through ``run.h5``: ``h5py.File("run.h5")["/cameras/view1/frames"][3]``.
"""

from collections.abc import Mapping
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from daq.errors import RecorderError, ShotFileError
from daq.files.atomic_file import commit, part_path, sync
from daq.files.header import RunClosing, RunHeader, ViewFormat
from daq.files.packed_file import pack_run, require_free
from daq.files.run_file import (
    RUN_FILE,
    SHOTS_FOLDER,
    Reference,
    ReferenceImages,
    add_outcome,
    add_references,
    read_closing,
    read_header,
    read_reference,
    read_shot_count,
    set_devices,
    shot_path,
    slots_of,
    write_run_file,
)
from daq.files.shot_file import EncodedShot, encode_shot, read_image_key, read_shot_file, write_encoded_shot
from daq.run_plan import ImageKey, PulsePair, RunKind, RunPlan
from daq.shot import DoubleFrame, ExposureRecord, FiredTrain, Image, LightPulse, Shot

__all__ = [
    "DoubleFrame",
    "ExposureRecord",
    "FiredTrain",
    "Image",
    "ImageKey",
    "LightPulse",
    "PulsePair",
    "RecorderError",
    "ReferenceImages",
    "RunHeader",
    "RunKind",
    "RunPlan",
    "RunReader",
    "RunWriter",
    "Shot",
    "ShotFileError",
    "ViewFormat",
    "list_runs",
    "open_runs",
    "pack",
]


class RunWriter:
    """Writes one run. ``with RunWriter(run_dir, header) as writer`` creates the directory.

    Parameters
    ----------
    run_dir : Path
        Must not exist: a run is never overwritten.
    header : RunHeader
        What the run is.

    Raises
    ------
    RecorderError
        The directory exists, or a shot does not have the format of the run.
    OSError
        The disk refuses.
    """

    def __init__(self, run_dir: Path, header: RunHeader) -> None:
        self.run_dir = run_dir
        self.header = header

    def __enter__(self) -> Self:
        try:
            (self.run_dir / SHOTS_FOLDER).mkdir(parents=True)
        except FileExistsError as error:
            raise RecorderError(f"{self.run_dir}: exists already, a run is never overwritten") from error
        try:
            write_run_file(self.run_dir, self.header)
            sync(self.run_dir.parent)
        except OSError:
            self._forget_directory()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave the run as it is: one without an outcome was interrupted."""

    def encode(self, shot: Shot) -> EncodedShot:
        """Compress a shot; several threads may do so at the same time."""
        return encode_shot(shot, self.header)

    def stage(self, index: int, encoded: EncodedShot) -> None:
        """Write a shot to its part and wait until that is on the disk."""
        part = part_path(self._free_path(index))
        try:
            write_encoded_shot(part, encoded, self.header)
            sync(part)
        except OSError:
            self.discard(index)
            raise

    def discard(self, index: int) -> None:
        """Remove a shot that was staged and shall not be committed."""
        part_path(shot_path(self.run_dir, index)).unlink(missing_ok=True)

    def commit(self, index: int) -> None:
        """Make a staged shot part of the run; call in the order of indices, a gap would hide later shots."""
        path = self._free_path(index)
        commit(part_path(path), path)

    def write_shot(self, shot: Shot) -> None:
        """Encode, stage and commit one shot."""
        self.stage(shot.index, self.encode(shot))
        self.commit(shot.index)

    def write_devices(self, devices: Mapping[str, Mapping[str, str]]) -> None:
        """Store what the devices of the rig say they are, by device name."""
        set_devices(self.run_dir, devices)

    def write_references(self, dark: ReferenceImages, background: ReferenceImages) -> None:
        """Store the mean dark and background images of each view, (frame, row, column) float32 in counts."""
        add_references(self.run_dir, self.header, {"dark": dark, "background": background})

    def finish(self, outcome: str, cause: str = "") -> None:
        """Write how the run ended, once."""
        add_outcome(self.run_dir, outcome, cause)

    def _forget_directory(self) -> None:
        """A run that could not even begin leaves nothing."""
        for folder in (self.run_dir / SHOTS_FOLDER, self.run_dir):
            with suppress(OSError):
                folder.rmdir()

    def _free_path(self, index: int) -> Path:
        path = shot_path(self.run_dir, index)
        if path.exists():
            raise RecorderError(f"{path}: exists already, a shot is never overwritten")
        return path


class RunReader:
    """Reads one run, also while it is being recorded; holds no file open.

    Parameters
    ----------
    run_dir : Path
        The run directory.

    Raises
    ------
    ShotFileError
        By every member: a file is missing, torn or damaged; the text names it. Other shots stay readable.
    """

    def __init__(self, run_dir: Path) -> None:
        self.run_dir = run_dir

    def __enter__(self) -> Self:
        _ = self.header
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Nothing is held."""

    @cached_property
    def header(self) -> RunHeader:
        """What the run is."""
        return read_header(self.run_dir)

    @property
    def outcome(self) -> str | None:
        """How the run ended; None while it is open, and for ever if its process was killed."""
        closing = self.closing
        return closing.outcome if closing else None

    @property
    def cause(self) -> str:
        """Why the run ended; empty if it is open or was completed."""
        closing = self.closing
        return closing.cause if closing else ""

    @property
    def ended_utc(self) -> str:
        """When the run ended, ISO 8601; empty if it is open."""
        closing = self.closing
        return closing.ended_utc if closing else ""

    @property
    def closing(self) -> RunClosing | None:
        """How, why and when the run ended; None while it is open, and for ever if its process was killed."""
        return read_closing(self.run_dir)

    @property
    def shot_count(self) -> int:
        """Number of slots up to the last committed shot; a shot lost since keeps its slot, the last ones too."""
        if not (self.run_dir / SHOTS_FOLDER).is_dir():
            reason = f"no folder {SHOTS_FOLDER}: it was packed into one file, or its shots were taken away"
            raise ShotFileError(f"{self.run_dir}: has {reason}")
        return max(slots_of(self.run_dir), read_shot_count(self.run_dir))

    def image_keys(self) -> NDArray[np.int64]:
        """ImageKey of every shot, (shot,); a shot that cannot be read counts as INVALID."""
        paths = (shot_path(self.run_dir, index) for index in range(self.shot_count))
        return np.array([read_image_key(path) for path in paths], np.int64)

    def read_shot(self, index: int) -> Shot:
        """Read one shot and check it against its checksums, and its number against the name of its file."""
        path = shot_path(self.run_dir, index)
        shot = read_shot_file(path, self.header)
        if shot.index != index:
            raise ShotFileError(f"{path}: holds shot {shot.index}, and is named otherwise: give it its name back")
        return shot

    def dark(self, view: str) -> NDArray[np.float32] | None:
        """Mean image without light, (frame, row, column) in counts; None if the run has none."""
        return self._reference(view, "dark")

    def background(self, view: str) -> NDArray[np.float32] | None:
        """Mean image with light and without spray, (frame, row, column) in counts; None if the run has none."""
        return self._reference(view, "background")

    def _reference(self, view: str, name: Reference) -> NDArray[np.float32] | None:
        if view not in self.header.views:
            raise ShotFileError(f"{self.run_dir}: has views {sorted(self.header.views)}, not {view!r}")
        return read_reference(self.run_dir, view, name)


def list_runs(data_dir: Path) -> tuple[Path, ...]:
    """Run directories below a folder, by name: run ids begin with their time."""
    return tuple(sorted(path.parent for path in data_dir.glob(f"*/{RUN_FILE}")))


def pack(run_dir: Path, out: Path) -> None:
    """Copy a run into one plain HDF5 file that needs no other file; ``out`` must not exist."""
    require_free(out)
    reader = RunReader(run_dir)
    pack_run(run_dir, reader.header, reader.shot_count, out)


def open_runs(data_dir: Path) -> tuple[str, ...]:
    """Ids of the runs without an outcome: active ones, and those whose process was killed."""
    found = []
    for run_dir in list_runs(data_dir):
        try:
            if RunReader(run_dir).outcome is None:
                found.append(run_dir.name)
        except ShotFileError:
            continue
    return tuple(found)
