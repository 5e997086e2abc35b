"""DATA_DIR/RUN.outcome.json: how a run ended, where its own directory could not be written while its program lived.

The next start of the server writes it into ``run.h5`` and removes the note.
"""

import logging
from pathlib import Path

from pydantic import TypeAdapter

from daq.errors import StorageError
from daq.files.atomic_file import replacing
from daq.files.header import RunClosing
from daq.files.storage import storing

_SUFFIX = ".outcome.json"
_CLOSING = TypeAdapter(RunClosing)
_LOG = logging.getLogger(__name__)


def note_path(run_dir: Path) -> Path:
    """Where the outcome of a run is kept that its directory did not take."""
    return run_dir.with_name(run_dir.name + _SUFFIX)


def write_note(run_dir: Path, closing: RunClosing) -> None:
    """Keep an outcome beside the run; if that is impossible too, the log is the last place for it."""
    try:
        with storing(run_dir.parent), replacing(note_path(run_dir)) as part:
            part.write_bytes(_CLOSING.dump_json(closing, indent=1))
    except StorageError as error:
        _LOG.error("run %s ended: %s; that is written nowhere: %s", run_dir.name, closing, error)


def read_note(run_dir: Path) -> RunClosing | None:
    """Outcome that was kept beside a run; None if there is no such note, or nobody can read it."""
    try:
        return _CLOSING.validate_json(note_path(run_dir).read_bytes())
    except (OSError, ValueError):
        return None
