"""What a dead process left in a data directory: runs are closed as INTERRUPTED, what is no run is set aside.

Nothing is deleted, no shot is touched, and a run that a living process writes is left alone.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from daq.causes import Cause, CauseCode
from daq.errors import AlreadyHeld, DaqError
from daq.files.atomic_file import PART_SUFFIX, RESERVE_SUFFIX
from daq.files.header import RunClosing
from daq.files.lock_file import hold_folder
from daq.files.outcome_note import note_path, read_note
from daq.files.run_file import RUN_FILE, SHOTS_FOLDER, add_closing, read_closing
from daq.files.storage import storing

INTERRUPTED = "interrupted"
INTERRUPTED_CAUSE = "its process ended before the run did: power, kill or crash"
ASIDE_FOLDER = "set-aside"
_OWN_NAME = re.compile(r"\d{8}T\d{6}-")


@dataclass(frozen=True)
class Recovered:
    """What was done about one run, for the log."""

    run_id: str
    text: str


def recover(data_dir: Path) -> list[Recovered]:
    """Close every run that is still open, and set aside what is none; the caller holds the data directory.

    Runs from before room for the outcome was reserved are not looked for: thousands would have to be opened.
    """
    reserved = sorted(path.parent for path in data_dir.glob(f"*/{RUN_FILE}{RESERVE_SUFFIX}"))
    unfinished = [run_dir for run_dir in reserved if not _is_headless(run_dir)]
    found = [told for run_dir in unfinished for told in _recovered(run_dir, close_run)]
    headless = sorted(path for path in data_dir.iterdir() if _OWN_NAME.match(path.name) and _is_headless(path))
    return found + [told for run_dir in headless for told in _recovered(run_dir, _set_run_aside)]


def close_run(run_dir: Path) -> Iterator[str]:
    """Set torn parts aside, and write how the run ended, if that is not known; says what was done."""
    lived_until_utc = last_sign_of_life_utc(run_dir / RUN_FILE, run_dir / SHOTS_FOLDER)
    for part in sorted(part for folder in (run_dir, run_dir / SHOTS_FOLDER) for part in folder.glob(f"*{PART_SUFFIX}")):
        yield f"{part.name} was not committed, it is set aside as {set_aside(part, run_dir)}"
    if read_closing(run_dir) is None:
        closing = read_note(run_dir) or _interrupted(lived_until_utc)
        add_closing(run_dir, closing)
        note_path(run_dir).unlink(missing_ok=True)
        yield f"{closing.outcome} at {closing.ended_utc}: {closing.cause}"


def _interrupted(ended_utc: str) -> RunClosing:
    cause = Cause(CauseCode.PROCESS_DIED, INTERRUPTED_CAUSE, ended_utc)
    return RunClosing(INTERRUPTED, INTERRUPTED_CAUSE, ended_utc, (cause,))


def _recovered(run_dir: Path, work: Callable[[Path], Iterator[str]]) -> Iterator[Recovered]:
    try:
        with storing(run_dir), hold_folder(run_dir):
            for text in work(run_dir):
                yield Recovered(run_dir.name, text)
    except AlreadyHeld:
        return  # another process writes it at this moment
    except (DaqError, OSError) as error:
        yield Recovered(run_dir.name, f"its outcome cannot be written: {error}")


def _is_headless(path: Path) -> bool:
    return path.is_dir() and not (path / RUN_FILE).exists()


def _set_run_aside(run_dir: Path) -> Iterator[str]:
    has_shots = any((run_dir / SHOTS_FOLDER).glob("*.h5"))
    aside = set_aside(run_dir, run_dir.parent)
    remedy = f"tomoshadow repair {aside} writes it anew from its shots"
    why, more = (f"it has no {RUN_FILE}", f"; {remedy}") if has_shots else (f"it has no {RUN_FILE} and is no run", "")
    yield f"{why}, it is set aside as {aside}{more}"


def set_aside(path: Path, keeper: Path) -> Path:
    """Move a file or folder into the folder for such things of a run or a data directory; returns its new path."""
    folder = keeper / ASIDE_FOLDER
    folder.mkdir(exist_ok=True)
    target, number = folder / path.name, 1
    while target.exists():
        number += 1
        target = folder / f"{path.name}-{number}"
    return path.rename(target)


def last_sign_of_life_utc(*paths: Path) -> str:
    """When some files, or folders with what lies in them, were written last, ISO 8601."""
    written = [path for one in paths if one.exists() for path in (one, *one.glob("*"))]
    newest_s = max(path.lstat().st_mtime for path in written)
    return datetime.fromtimestamp(newest_s, UTC).isoformat()
