"""What can be mended in a run without touching a shot: strangers are set aside, what is lost is written.

A torn or damaged shot keeps its place and its name: without it, other programs would not see those after it.
"""

from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

from daq.errors import ShotFileError
from daq.files.atomic_file import RESERVE_SUFFIX
from daq.files.header import RunClosing, RunHeader
from daq.files.lock_file import hold_folder
from daq.files.outcome_note import read_note, write_note
from daq.files.recovery import INTERRUPTED, close_run, last_sign_of_life_utc, set_aside
from daq.files.run_directory import RunReader
from daq.files.run_file import RUN_FILE, SHOTS_FOLDER, write_run_file
from daq.files.shot_file import read_began, read_formats, read_shot_file
from daq.files.storage import storing
from daq.files.verification import ASKED_SHOTS, FlawKind, is_strange, runs_of_shots, verify

LOST_WITH_HEADER = (
    "lost with the old one: plan, configuration, devices, versions, calibration, polarity (shadow is written), rate, "
    "means of dark and background, how it ended"
)
_OUTCOME_LOST = "its run.h5 was lost, and with it how the run ended"
_SET_ASIDE = (FlawKind.FOREIGN, FlawKind.RENAMED)


def repair(run_dir: Path) -> Iterator[str]:
    """Mend what can be mended; says step by step what is done.

    Raises
    ------
    AlreadyHeld
        A living process writes the run.
    ShotFileError
        ``run.h5`` is lost, and no shot can be read that would tell what it was.
    StorageError
        The disk refuses.
    """
    with hold_folder(run_dir), storing(run_dir):
        yield from _write_lost_header(run_dir)
        for flaw in verify(run_dir).flaws:
            if flaw.kind in _SET_ASIDE:
                yield f"{flaw.file} is set aside as {set_aside(run_dir / flaw.file, run_dir)}: {flaw.kind}"
        yield from close_run(run_dir)


def _write_lost_header(run_dir: Path) -> Iterator[str]:
    with suppress(ShotFileError):
        if not is_strange(run_dir, RunReader(run_dir).header):
            return
    header = _header_of_shots(run_dir)
    lived_until_utc = last_sign_of_life_utc(run_dir / SHOTS_FOLDER)
    for name in (RUN_FILE, RUN_FILE + RESERVE_SUFFIX):
        if (run_dir / name).exists():
            yield f"{name} is set aside as {set_aside(run_dir / name, run_dir)}"
    # The outcome comes last, with the count of shots: by this repair, or by the next one if this one is killed.
    if read_note(run_dir) is None:
        write_note(run_dir, RunClosing(INTERRUPTED, _OUTCOME_LOST, lived_until_utc))
    write_run_file(run_dir, header)
    yield f"{RUN_FILE} is written anew from the shots{_renamed(run_dir, header)}; {LOST_WITH_HEADER}"


def _renamed(run_dir: Path, header: RunHeader) -> str:
    """What it says where shots do not name their directory."""
    if header.run_id == run_dir.name:
        return ""
    return f" as run {header.run_id}, which most of the first {ASKED_SHOTS} name: none of these names {run_dir.name}"


def _header_of_shots(run_dir: Path) -> RunHeader:
    """What a shot tells of its run: one of this directory, or of what most are, as others may be strangers."""
    paths = sorted((run_dir / SHOTS_FOLDER).glob("*.h5"))
    told = runs_of_shots(run_dir)
    often = Counter(told.values())
    trusted = sorted(told, key=lambda path: (told[path] == run_dir.name, often[told[path]]), reverse=True)
    for path in (*trusted, *paths):
        with suppress(ShotFileError):
            return _header_of_shot(path)
    raise ShotFileError(f"{run_dir}: its {RUN_FILE} cannot be read, and no shot is left that tells what it was")


def _header_of_shot(path: Path) -> RunHeader:
    run_id, views, frames = read_formats(path)
    header = RunHeader(run_id=run_id, created_utc="", views=views, frames_per_shot=2 if frames == 2 else 1)
    shot = read_shot_file(path, header)
    pulses = next(iter(shot.fired.pulses.values()), ()) if shot.fired else ()
    known = {
        "created_utc": read_began(path) or datetime.fromtimestamp(shot.host_time_ns / 1e9, UTC).isoformat(),
        "separation_ns": pulses[1].start_ns - pulses[0].start_ns if len(pulses) == 2 else None,
    }
    return header.model_copy(update=known)
