"""Damaged files: they are told, kept under another name where a new one takes their place, and never deleted."""

from datetime import UTC, datetime
from pathlib import Path

from server.lab.events import EventPublisher


def set_aside(path: Path, reason: str, events: EventPublisher, companions: tuple[str, ...] = ()) -> Path:
    """Give a damaged file another name beside it; returns the name that it has then.

    Parameters
    ----------
    path : Path
        The file.
    reason : str
        What is wrong with it, for the operator.
    events : EventPublisher
        Gets ``file_damaged``.
    companions : tuple of str
        Endings of the names of files that belong to it.
    """
    try:
        aside = _free_name(path)
        _rename(path, aside, ("", *companions))
    except OSError as error:  # the disk is read-only, say: whoever asks goes on without the file
        tell(path, f"{reason}; it cannot be set aside: {error}", events)
        return path
    tell(path, f"{reason}; it is kept as {aside.name}", events)
    return aside


def tell(path: Path, reason: str, events: EventPublisher) -> None:
    """Let the operator know of a damaged file."""
    events.publish("file_damaged", file=str(path), reason=reason)


def _rename(path: Path, aside: Path, endings: tuple[str, ...]) -> None:
    for ending in endings:
        whole = path.with_name(path.name + ending)
        if whole.exists():
            whole.rename(aside.with_name(aside.name + ending))


def _free_name(path: Path) -> Path:
    stem = f"{path.name}.damaged-{datetime.now(UTC):%Y%m%dT%H%M%S}"
    name, number = path.with_name(stem), 1
    while name.exists():
        number += 1
        name = path.with_name(f"{stem}-{number}")
    return name
