"""Is a run whole? Every frame is read and its CRC compared; what is wrong is named, file by file."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import islice
from pathlib import Path

from daq.counted import counted
from daq.errors import AlreadyHeld, DamagedFrame, DamagedNumbers, ForeignFile, RenamedFile, ShotFileError
from daq.files.atomic_file import PART_SUFFIX
from daq.files.header import RunClosing, RunHeader
from daq.files.later_notes import NOTES_FILE, read_changes
from daq.files.lock_file import hold_folder
from daq.files.references_file import damaged_references
from daq.files.run_directory import RunReader
from daq.files.run_file import RUN_FILE, SHOTS_FOLDER, is_shot, other_programs_see, read_shot_count, shot_path
from daq.files.shot_file import read_formats, reading_shot

Done = Callable[[int, int], None]
_EOF_ADDRESS = slice(28, 36)
"""Where the superblock of HDF5, version 2 and 3, says how long its file is (HDF5 File Format Specification, II.A)."""
ASKED_SHOTS = 100
"""The first readable shots that are asked what run they are of: a long run is not opened from end to end."""
_SIGNATURE = b"\x89HDF\r\n\x1a\n"


class FlawKind(StrEnum):
    """What can be wrong with a file of a run."""

    MISSING = "missing"
    TRUNCATED = "truncated"
    DAMAGED = "damaged"
    FOREIGN = "foreign"
    RENAMED = "renamed"
    UNREADABLE = "unreadable"
    NOT_COMMITTED = "not_committed"
    NO_OUTCOME = "no_outcome"
    BEING_WRITTEN = "being_written"


@dataclass(frozen=True)
class Flaw:
    """One thing that is wrong.

    Parameters
    ----------
    kind : FlawKind
        What.
    file : str
        Relative to the run.
    text : str
        For people.
    """

    kind: FlawKind
    file: str
    text: str


@dataclass(frozen=True)
class Verification:
    """What a run was found to be.

    Parameters
    ----------
    outcome : str | None
        How it ended; None if it does not say.
    shots, sound_shots : int
        Slots, and those that hold what was written.
    frames : int
        Exposures whose CRC was found right.
    flaws : tuple[Flaw, ...]
        All that is wrong; none if the run is sound.
    """

    outcome: str | None
    shots: int
    sound_shots: int
    frames: int
    flaws: tuple[Flaw, ...]

    @property
    def sound(self) -> bool:
        """Nothing is wrong."""
        return not self.flaws


def verify(run_dir: Path, done: Done = lambda _done, _total: None) -> Verification:
    """Look at every file of a run.

    Parameters
    ----------
    run_dir : Path
        The run directory.
    done : Callable[[int, int], None]
        Told after each shot how many of how many are looked at.
    """
    reader = RunReader(run_dir)
    strangers = tuple(_strangers(run_dir))
    try:
        header, closing = reader.header, reader.closing
        if is_strange(run_dir, header):
            return Verification(None, 0, 0, 0, (_strange(run_dir, header), *strangers))
        strangers += tuple(_flaws_of_notes(run_dir, header))
        if not (run_dir / SHOTS_FOLDER).is_dir():
            return _without_shots(run_dir, header, closing, strangers)
        shots, strangers = reader.shot_count, (*_flaws_of_run_file(run_dir, header), *strangers)
    except ShotFileError as error:
        there = (run_dir / RUN_FILE).exists()
        text = f"{error}; tomoshadow repair {run_dir} writes it anew from the shots, where one can be read"
        flaw = Flaw(FlawKind.UNREADABLE if there else FlawKind.MISSING, RUN_FILE, text)
        return Verification(None, 0, 0, 0, (flaw, *strangers))
    flaws = [] if closing else [_open_flaw(run_dir)]
    bad: list[Flaw] = []
    for index in range(shots):
        bad += _flaws_of_shot(reader, index)
        done(index + 1, shots)
    sound = shots - len(bad)
    frames = sound * header.frames_per_shot * len(header.views)
    return Verification(closing.outcome if closing else None, shots, sound, frames, (*flaws, *bad, *strangers))


def runs_of_shots(run_dir: Path) -> dict[Path, str]:
    """Which run the first readable shots are of, as each of them says."""
    paths = sorted((run_dir / SHOTS_FOLDER).glob("*.h5"))
    return dict(islice(((path, run_id) for path in paths if (run_id := _run_of(path))), ASKED_SHOTS))


def is_strange(run_dir: Path, header: RunHeader) -> bool:
    """Whether run.h5 is of another run than the directory and its shots."""
    if header.run_id == run_dir.name:
        return False
    paths = sorted((run_dir / SHOTS_FOLDER).glob("*.h5"))
    own = (is_own for path in paths if (is_own := _is_own(path, header)) is not None)
    first = next(own, None)
    return first is False and not any(islice(own, ASKED_SHOTS - 1))


def _run_of(path: Path) -> str | None:
    try:
        return read_formats(path)[0]
    except ShotFileError:
        return None


def _is_own(path: Path, header: RunHeader) -> bool | None:
    """Whether a shot is of this run; None if it cannot be read."""
    try:
        with reading_shot(path, header):
            return True
    except ForeignFile:
        return False
    except ShotFileError:
        return None


def _strange(run_dir: Path, header: RunHeader) -> Flaw:
    text = (
        f"{run_dir / RUN_FILE}: is that of run {header.run_id}, and no shot here is: copy its own back from a backup; "
        f"tomoshadow repair {run_dir} sets it aside and writes one anew from the shots"
    )
    return Flaw(FlawKind.FOREIGN, RUN_FILE, text)


def _without_shots(
    run_dir: Path, header: RunHeader, closing: RunClosing | None, strangers: tuple[Flaw, ...]
) -> Verification:
    """What run.h5 alone tells: all shots are missing, and it knows how many they were."""
    recorded = read_shot_count(run_dir)
    planned = header.plan.total_shots if header.plan else None
    plan = "" if planned is None else f" of {planned} that were planned"
    lay = f"{counted(recorded, 'shot')}{plan} lay" if recorded else f"nobody knows how many shots{plan} lay"
    text = f"{run_dir}: has no folder {SHOTS_FOLDER}; {lay} in it: bring it back, or copy it from a backup"
    outcome = closing.outcome if closing else None
    return Verification(outcome, recorded, 0, 0, (Flaw(FlawKind.MISSING, SHOTS_FOLDER, text), *strangers))


def _flaws_of_shot(reader: RunReader, index: int) -> list[Flaw]:
    path = shot_path(reader.run_dir, index)
    try:
        reader.read_shot(index)
    except ShotFileError as error:
        return [Flaw(_kind_of(path, error), f"{SHOTS_FOLDER}/{path.name}", str(error))]
    return []


def _kind_of(path: Path, error: ShotFileError) -> FlawKind:
    if not path.is_file():
        return FlawKind.MISSING
    if _is_truncated(path):
        return FlawKind.TRUNCATED
    kinds: dict[type[Exception], FlawKind] = {
        ForeignFile: FlawKind.FOREIGN,
        RenamedFile: FlawKind.RENAMED,
        DamagedFrame: FlawKind.DAMAGED,
        DamagedNumbers: FlawKind.DAMAGED,
    }
    return kinds.get(type(error), FlawKind.UNREADABLE)


def _is_truncated(path: Path) -> bool:
    """Whether a file is shorter than it says; one that does not begin as HDF5 is something else."""
    with path.open("rb") as file:
        head = file.read(_EOF_ADDRESS.stop)
    size = path.stat().st_size
    if len(head) < _EOF_ADDRESS.stop:
        return _SIGNATURE.startswith(head[: len(_SIGNATURE)])
    return head.startswith(_SIGNATURE) and size < int.from_bytes(head[_EOF_ADDRESS], "little")


def _strangers(run_dir: Path) -> list[Flaw]:
    """Files that are no shots, among the shots; parts that were never committed, there and above."""
    found = []
    for path in sorted([*run_dir.glob(f"*{PART_SUFFIX}"), *(run_dir / SHOTS_FOLDER).glob("*")]):
        name = str(path.relative_to(run_dir))
        if path.suffix == PART_SUFFIX:
            found.append(Flaw(FlawKind.NOT_COMMITTED, name, f"{path}: was being written when its process ended"))
        elif not is_shot(path):
            found.append(Flaw(FlawKind.FOREIGN, name, f"{path}: no file that is named by the number of a shot"))
    return found


def _flaws_of_notes(run_dir: Path, header: RunHeader) -> list[Flaw]:
    try:
        read_changes(run_dir, header)
    except ShotFileError as error:
        return [Flaw(FlawKind.FOREIGN, NOTES_FILE, str(error))]
    return []


def _flaws_of_run_file(run_dir: Path, header: RunHeader) -> Iterator[Flaw]:
    """What is wrong in run.h5 beside what it tells of the run: its references, and what other programs see in it."""
    for text in (*damaged_references(run_dir, header), *other_programs_see(run_dir, header)):
        yield Flaw(FlawKind.DAMAGED, RUN_FILE, text)


def _open_flaw(run_dir: Path) -> Flaw:
    try:
        with hold_folder(run_dir):
            return Flaw(FlawKind.NO_OUTCOME, RUN_FILE, f"{run_dir}: has no outcome, its process ended before it did")
    except AlreadyHeld as error:
        return Flaw(FlawKind.BEING_WRITTEN, RUN_FILE, str(error))
