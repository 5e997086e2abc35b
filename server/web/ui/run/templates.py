"""Templates: forms that operators have kept under a name, one JSON file each, beside the runs."""

from pathlib import Path
from typing import Any

from pydantic import ValidationError

from daq.files.atomic_file import replacing
from daq.files.storage import storing
from daq.names import is_identifier
from server.lab.damage import set_aside
from server.lab.errors import Unprocessable
from server.lab.events import EventPublisher
from server.web.ui.draft import StoredDraft

_OF_THE_DAY = ("references", "are_references_chosen", "calibration")
"""Belong to the day on which a run is made, and to no template."""


class TemplateStore:
    """The templates of one rig.

    Parameters
    ----------
    folder : Path
        Made with the first of them.
    events : EventPublisher
        Told of files that cannot be read; they are set aside.
    """

    def __init__(self, folder: Path, events: EventPublisher) -> None:
        self._folder = folder
        self._events = events

    def names(self) -> list[str]:
        """All that can be read, by name."""
        files = sorted(self._folder.glob("*.json"))
        return [path.stem for path in files if is_identifier(path.stem) and self._read(path) is not None]

    def load(self, name: str) -> dict[str, Any]:
        """Values of the form; empty where there is no such template any more."""
        path = self._folder / f"{name}.json"
        return (self._read(path) if is_identifier(name) and path.is_file() else None) or {}

    def save(self, name: str, values: dict[str, Any]) -> None:
        """Keep a form; one of the same name is replaced.

        Raises
        ------
        Unprocessable
            That is no name for a file.
        StorageError
            The disk refuses.
        """
        if not is_identifier(name):
            raise Unprocessable(f"{name!r} is no name for a template: letters, digits, space . _ -")
        kept = {key: value for key, value in values.items() if key not in _OF_THE_DAY}
        text = StoredDraft.model_validate(kept).model_dump_json(exclude_unset=True, indent=1)
        with storing(self._folder.parent):
            self._folder.mkdir(parents=True, exist_ok=True)
            with replacing(self._folder / f"{name}.json") as part:
                part.write_text(text)

    def remove(self, name: str) -> None:
        """Forget a template."""
        if is_identifier(name):
            (self._folder / f"{name}.json").unlink(missing_ok=True)

    def _read(self, path: Path) -> dict[str, Any] | None:
        try:
            stored = StoredDraft.model_validate_json(path.read_bytes())
        except (OSError, ValidationError) as error:
            set_aside(path, f"template of a run: {error}", self._events)
            return None
        return {key: value for key, value in stored.model_dump(mode="json", exclude_unset=True).items()}
