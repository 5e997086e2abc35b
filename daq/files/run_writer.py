"""RunWriter: one run as it is written; whatever the disk does, how it ended finds its place."""

from collections.abc import Mapping
from contextlib import ExitStack, suppress
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Self

from daq.errors import RecorderError
from daq.files.atomic_file import PART_SUFFIX, commit, part_path, reserve_path, sync
from daq.files.header import RunClosing, RunHeader
from daq.files.lock_file import hold_folder
from daq.files.references_file import ReferenceImages, add_references
from daq.files.run_file import (
    RUN_FILE,
    SHOTS_FOLDER,
    add_closing,
    reserve_closing,
    set_devices,
    shot_path,
    write_run_file,
)
from daq.files.shot_file import EncodedShot, encode_shot, write_encoded_shot
from daq.files.storage import require_room, storing
from daq.shot import Shot


class RunWriter:
    """Writes one run. ``with RunWriter(run_dir, header) as writer`` creates the directory.

    Parameters
    ----------
    run_dir : Path
        Must not exist: a run is never overwritten.
    header : RunHeader
        What the run is.
    margin_bytes : int
        What shots leave free on the disk; 0: they may fill it.

    Raises
    ------
    RecorderError
        The directory exists, or a shot does not have the format of the run.
    StorageError
        The disk refuses; the text says what to do.
    """

    def __init__(self, run_dir: Path, header: RunHeader, margin_bytes: int = 0) -> None:
        self.run_dir = run_dir
        self.header = header
        self._margin_bytes = margin_bytes
        self._held = ExitStack()
        self._held_dir = run_dir

    def __enter__(self) -> Self:
        return self.open()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave the run as it is: one without an outcome was interrupted."""
        self.close()

    def open(self) -> Self:
        """Make the directory, with room for the outcome; a run that cannot even begin leaves nothing."""
        with storing(self.run_dir):
            try:
                (self.run_dir / SHOTS_FOLDER).mkdir(parents=True)
            except FileExistsError as error:
                raise RecorderError(f"{self.run_dir}: exists already, a run is never overwritten") from error
            with ExitStack() as undo:
                undo.callback(self._forget_directory)
                self._begin()
                undo.pop_all()
        return self

    def close(self) -> None:
        """Let go of the directory: nobody writes there any more."""
        self._held.close()

    def encode(self, shot: Shot) -> EncodedShot:
        """Compress a shot; several threads may do so at the same time."""
        return encode_shot(shot, self.header)

    def stage(self, index: int, encoded: EncodedShot) -> None:
        """Write a shot to its part and wait until that is on the disk."""
        with storing(self.run_dir):
            part = part_path(self._free_path(index))
            require_room(self.run_dir, encoded.size_bytes, self._margin_bytes)
            try:
                write_encoded_shot(part, encoded, self.header)
                sync(part)
            except (OSError, RuntimeError):
                self.discard(index)
                raise

    def discard(self, index: int) -> None:
        """Remove a shot that was staged and shall not be committed, if the disk lets us."""
        with suppress(OSError):
            part_path(shot_path(self.run_dir, index)).unlink(missing_ok=True)

    def commit(self, index: int) -> None:
        """Make a staged shot part of the run; call in the order of indices, a gap would hide later shots."""
        with storing(self.run_dir):
            path = self._free_path(index)
            commit(part_path(path), path)

    def write_shot(self, shot: Shot) -> None:
        """Encode, stage and commit one shot."""
        self.stage(shot.index, self.encode(shot))
        self.commit(shot.index)

    def write_devices(self, devices: Mapping[str, Mapping[str, str]]) -> None:
        """Store what the devices of the rig say they are, by device name."""
        with storing(self.run_dir):
            set_devices(self.run_dir, devices)
            reserve_closing(self.run_dir)

    def write_references(self, dark: ReferenceImages, background: ReferenceImages) -> None:
        """Store the mean dark and background images of each view, (frame, row, column) float32 in counts."""
        with storing(self.run_dir):
            add_references(self.run_dir, self.header, {"dark": dark, "background": background})
            reserve_closing(self.run_dir)

    def finish(self, outcome: str, cause: str = "") -> None:
        """Write that the run ends now, once."""
        self.write_closing(RunClosing(outcome, cause, datetime.now(UTC).isoformat()))

    def write_closing(self, closing: RunClosing) -> None:
        """Write how the run ended, once; also into a directory that was moved, or whose disk was unmounted lazily."""
        with storing(self.run_dir):
            try:
                add_closing(self.run_dir, closing)
            except FileNotFoundError:
                add_closing(self._held_dir, closing)
            for part in (self._held_dir / SHOTS_FOLDER).glob(f"*{PART_SUFFIX}"):
                part.unlink(missing_ok=True)  # of a shot that is not stored: the disk did not let go of it before

    def _begin(self) -> None:
        self._held_dir = self._held.enter_context(hold_folder(self.run_dir))
        reserve_closing(self.run_dir)  # first: whoever finds it without an outcome knows that the run is not over
        write_run_file(self.run_dir, self.header)
        reserve_closing(self.run_dir)
        sync(self.run_dir.parent)

    def _forget_directory(self) -> None:
        self.close()
        for file in (self.run_dir / RUN_FILE, reserve_path(self.run_dir / RUN_FILE)):
            file.unlink(missing_ok=True)
        for folder in (self.run_dir / SHOTS_FOLDER, self.run_dir):
            with suppress(OSError):
                folder.rmdir()

    def _free_path(self, index: int) -> Path:
        path = shot_path(self.run_dir, index)
        if path.exists():
            raise RecorderError(f"{path}: exists already, a shot is never overwritten")
        return path
