"""The notes of a run are changed after it was recorded: its own file stays as it is."""

from threading import Lock
from typing import Annotated

from pydantic import Field

from daq.files.lock_file import hold_folder
from daq.files.run_directory import NotesChange, RunNotes, RunReader, Spray, add_change
from daq.files.storage import storing
from daq.frozen_model import FrozenModel
from server.lab.errors import Conflict
from server.lab.runs.run_store import RunStore
from server.lab.runs.run_summary import RunSummary

_CHANGING = Lock()
"""Of two who change the notes of a run at once, the second one sees what the first one wrote."""


class NotesHistory(FrozenModel):
    """The notes of a run, from its start on."""

    recorded: Annotated[RunNotes, Field(description="as they were when the run was recorded")]
    recorded_spray: Annotated[Spray | None, Field(description="nozzle and axis, likewise; null: nobody stated them")]
    changes: Annotated[tuple[NotesChange, ...], Field(description="since then, the oldest one first")]


class NewNotes(FrozenModel):
    """Notes that take the place of others."""

    notes: Annotated[RunNotes, Field(description="all of them; what is left out is empty from now on")]
    spray: Annotated[
        Spray | None, Field(description="nozzle and axis, for what is measured from now on; null: they stay")
    ] = None
    seen: Annotated[
        int | None,
        Field(ge=0, description="how many changes there had been when they were written: if there are others, 409"),
    ] = None


def notes_history(runs: RunStore, run_id: str) -> NotesHistory:
    """Return what stood in the notes of a run, and when.

    Raises
    ------
    NotFound
        There is no such run.
    ShotFileError
        It cannot be read, or its later notes.
    """
    run = runs.reader(run_id)
    header = run.header
    return NotesHistory(recorded=header.notes, recorded_spray=header.spray, changes=run.notes_changes)


def change_notes(runs: RunStore, run_id: str, new: NewNotes, who: str) -> RunSummary:
    """Write the notes of a run anew.

    Parameters
    ----------
    runs : RunStore
        Knows it.
    run_id : str
        Which one.
    new : NewNotes
        What is to stand there.
    who : str
        Who wants it.

    Raises
    ------
    NotFound
        There is no such run.
    Conflict, AlreadyHeld
        It is being recorded, or somebody else changed them meanwhile.
    ShotFileError
        It cannot be read, or its later notes.
    RecorderError
        They were changed too often, or the disk refuses.
    """
    with _CHANGING:
        run = RunReader(runs.directory(run_id))
        runs.require_closed(run_id)
        with storing(run.run_dir), hold_folder(run.run_dir):
            _require_seen(run, new.seen)
            add_change(run.run_dir, run.header, new.notes, who, new.spray)
    return runs.summary(run_id)


def _require_seen(run: RunReader, seen: int | None) -> None:
    changes = run.notes_changes
    if seen in (None, len(changes)):
        return
    by = f"by {changes[-1].who} at {changes[-1].at_utc}" if changes else "by nobody: they are as recorded"
    raise Conflict(f"the notes of run {run.header.run_id} are not those that were seen, changed {by}: look again")
