"""The data contract: runs on disk. What ``processing`` needs of ``daq`` it imports from here.

::

    RUN/run.h5          what the run is, its references, its outcome, a view over all shots   (daq.files.run_file)
    RUN/notes.json      notes, nozzle and axis that were changed later; is there only then    (daq.files.later_notes)
    RUN/shots/N.h5      one shot, committed by rename after fsync                             (daq.files.shot_file)

Any HDF5 reader sees the whole run through ``run.h5``: ``h5py.File("run.h5")["/cameras/view1/frames"][3]``.
"""

import os
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from daq.causes import Cause
from daq.errors import RecorderError, ShotFileError
from daq.files.header import RunClosing, RunHeader, ViewFormat
from daq.files.later_notes import NotesChange, RunConditions, add_change, read_changes
from daq.files.lock_file import hold_folder
from daq.files.packed_file import pack_run, require_free
from daq.files.references_file import Reference, ReferenceImages, read_reference
from daq.files.run_file import (
    RUN_FILE,
    SHOTS_FOLDER,
    read_closing,
    read_header,
    read_shot_count,
    shot_path,
    slots_of,
)
from daq.files.run_writer import RunWriter
from daq.files.shot_file import Exposures, read_image_key, read_shot_of
from daq.run_notes import RunNotes, Spray
from daq.run_plan import ImageKey, PulsePair, RunKind, RunPlan
from daq.shot import DoubleFrame, ExposureRecord, FiredTrain, Image, LightPulse, Shot

__all__ = [
    "DoubleFrame",
    "ExposureRecord",
    "FiredTrain",
    "Image",
    "ImageKey",
    "LightPulse",
    "NotesChange",
    "PulsePair",
    "RecorderError",
    "ReferenceImages",
    "RunConditions",
    "RunHeader",
    "RunKind",
    "RunNotes",
    "RunPlan",
    "RunReader",
    "RunWriter",
    "Shot",
    "ShotFileError",
    "Spray",
    "ViewFormat",
    "add_change",
    "list_runs",
    "pack",
]


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
    def causes(self) -> tuple[Cause, ...]:
        """Every reason why the run ended, the first one first; empty in runs from before they were kept."""
        closing = self.closing
        return closing.causes if closing else ()

    @property
    def unstored(self) -> tuple[int, ...]:
        """Shots that were fired and never reached the disk."""
        closing = self.closing
        return closing.unstored if closing else ()

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

    @property
    def notes_changes(self) -> tuple[NotesChange, ...]:
        """What was written into its notes later, the oldest change first; ``header.notes`` are as recorded."""
        return read_changes(self.run_dir, self.header)

    @property
    def conditions(self) -> RunConditions:
        """Notes, nozzle and axis as they hold now: those of the header, or what was written later."""
        return RunConditions.after(self.header, self.notes_changes)

    def image_keys(self) -> NDArray[np.int64]:
        """ImageKey of every shot, (shot,); a shot that cannot be read counts as INVALID."""
        paths = (shot_path(self.run_dir, index) for index in range(self.shot_count))
        return np.array([read_image_key(path) for path in paths], np.int64)

    def read_shot(self, index: int, exposures: Exposures = "ab") -> Shot:
        """Read one shot and check it against its checksums, and its number against the name of its file.

        Exposure A alone is a shot as runs with single exposures have them; B stays on the disk.
        """
        return read_shot_of(shot_path(self.run_dir, index), self.header, index, exposures)

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
    with suppress(FileNotFoundError, NotADirectoryError), os.scandir(data_dir) as entries:
        names = [entry.name for entry in entries if os.path.exists(f"{entry.path}/{RUN_FILE}")]  # of many thousands
        return tuple(data_dir / name for name in sorted(names))
    return ()


def pack(run_dir: Path, out: Path) -> None:
    """Copy a run into one plain HDF5 file that needs no other file; ``out`` must not exist.

    Raises
    ------
    AlreadyHeld
        A living process writes the run: the file would hold the half of it.
    """
    require_free(out)
    reader = RunReader(run_dir)
    if reader.closing is None:
        with hold_folder(run_dir):
            pass
    pack_run(run_dir, reader.header, reader.shot_count, out)
