"""RUN/notes.json: what was written of the conditions of a run after it was recorded, by whom and when.

``run.h5`` stays as it is. The last change is what holds; a run without this file has the notes of its header.
"""

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError

from daq.errors import RecorderError, ShotFileError
from daq.files.atomic_file import replacing
from daq.files.header import RunHeader
from daq.files.run_file import read_later_notes
from daq.files.storage import storing
from daq.frozen_model import FrozenModel
from daq.run_notes import RunNotes, Spray

NOTES_FILE = "notes.json"
MOST_CHANGES = 200
"""Of one run: lists of runs read all of them."""


class NotesChange(FrozenModel):
    """The notes of a run were written anew."""

    who: Annotated[str, Field(description="who did it, as the events name him")]
    at_utc: Annotated[str, Field(description="when, ISO 8601")]
    before: Annotated[RunNotes, Field(description="what stood there until then")]
    notes: Annotated[RunNotes, Field(description="what stands there since")]
    spray: Annotated[
        Spray | None, Field(description="nozzle and axis, where they were written anew too; null: they are as before")
    ] = None


class LaterNotes(FrozenModel):
    """All changes of the notes of a run: the file."""

    file_schema: Annotated[Literal["tomoshadow-notes"], Field(alias="schema")] = "tomoshadow-notes"
    schema_version: Literal[1] = 1
    run_id: Annotated[str, Field(description="the run of which they are")]
    changes: Annotated[tuple[NotesChange, ...], Field(description="the oldest one first")] = ()


@dataclass(frozen=True)
class RunConditions:
    """What holds of a run now.

    Parameters
    ----------
    notes : RunNotes
        As they were last written.
    spray : Spray | None
        Nozzle and axis, likewise; None where nobody knows.
    changed : NotesChange | None
        The last change; None where all is as recorded.
    """

    notes: RunNotes
    spray: Spray | None
    changed: NotesChange | None

    @classmethod
    def after(cls, header: RunHeader, changes: tuple[NotesChange, ...]) -> "RunConditions":
        """What was recorded, and what was written since."""
        if not changes:
            return cls(header.notes, header.spray, None)
        sprays = [header.spray, *(change.spray for change in changes)]
        return cls(changes[-1].notes, next((one for one in reversed(sprays) if one), None), changes[-1])


def read_changes(run_dir: Path, header: RunHeader) -> tuple[NotesChange, ...]:
    """Changes of the notes of a run, the oldest one first; those that a packed file carries, if none lie beside it.

    Raises
    ------
    ShotFileError
        The file is damaged, or of another run.
    """
    path = run_dir / NOTES_FILE
    try:
        written = path.read_bytes() if path.exists() else read_later_notes(run_dir)
        later = LaterNotes.model_validate_json(written) if written else LaterNotes(run_id=header.run_id)
    except (OSError, ValidationError) as error:
        raise _unreadable(path, f"it cannot be read ({_first_line(error)})") from error
    if later.run_id != header.run_id:
        raise _unreadable(path, f"it is of run {later.run_id!r}")
    return later.changes


def add_change(run_dir: Path, header: RunHeader, notes: RunNotes, who: str, spray: Spray | None = None) -> None:
    """Write the notes of a run anew, and nozzle and axis where they are given; the same ones are no change.

    Raises
    ------
    ShotFileError
        What stands there cannot be read.
    RecorderError
        They were changed as often as they may be.
    StorageError
        The disk refuses.
    """
    changes = read_changes(run_dir, header)
    now = RunConditions.after(header, changes)
    if notes == now.notes and spray in (None, now.spray):
        return
    if len(changes) >= MOST_CHANGES:
        raise RecorderError(f"{run_dir}: its notes were changed {MOST_CHANGES} times, and take no more changes")
    at_utc = datetime.now(UTC).isoformat(timespec="seconds")
    change = NotesChange(who=who, at_utc=at_utc, before=now.notes, notes=notes, spray=spray)
    with storing(run_dir), replacing(run_dir / NOTES_FILE) as part:
        part.write_text(document_of(header, (*changes, change)), encoding="utf-8")


def document_of(header: RunHeader, changes: tuple[NotesChange, ...]) -> str:
    """What stands in the file."""
    return LaterNotes(run_id=header.run_id, changes=changes).model_dump_json(indent=1, by_alias=True)


def _unreadable(path: Path, problem: str) -> ShotFileError:
    told = "the notes that were recorded hold: copy it back from a backup, or let tomoshadow repair set it aside"
    return ShotFileError(f"{path}: {problem}; {told}")


def _first_line(error: Exception) -> str:
    return str(error).partition("\n")[0]
