"""One rule for all that commands write: what exists is replaced if asked for, and only by what is whole."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from processing.errors import BadInput


class OutputExistsError(BadInput):
    """There is something already where a result would go; the text names it."""


def require_free(*targets: Path, overwrite: bool, made_with: Sequence[str] = ()) -> None:
    """Refuse, before anything is computed, to take the place of what exists. An empty folder is free.

    Parameters
    ----------
    targets : Path
        Files or folders that would be written.
    overwrite : bool
        They may be replaced. A folder may be if it holds one of ``made_with``, so that nobody loses his home.
    made_with : sequence of str
        Paths in a folder that show who made it.

    Raises
    ------
    OutputExistsError
        A target is there, or a file is where its folder would be.
    """
    for target in targets:
        if (place := next(folder for folder in target.absolute().parents if folder.exists())) and not place.is_dir():
            raise OutputExistsError(f"{place}: is a file, no folder for {target.name}")
        if not target.exists() or (target.is_dir() and not any(target.iterdir())):
            continue
        if not overwrite:
            raise OutputExistsError(f"{target}: exists; only --overwrite replaces it")
        if target.is_dir() and not any((target / mark).exists() for mark in made_with):
            raise OutputExistsError(f"{target}: is a folder that this command has not made; it is not replaced")


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """Yield a path of the same name in a folder beside; what is written there takes its place at the end.

    That is the target, file or folder, and whatever is written next to it. If the block raises, all stays as it was.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix=".", suffix=".part", dir=target.parent) as part:
        yield Path(part) / target.name
        for written in sorted(Path(part).iterdir()):
            _take_place(written, target.with_name(written.name))


def _take_place(written: Path, place: Path) -> None:
    if not place.is_dir():
        written.replace(place)
        return
    aside = written.with_name(f"{written.name}.replaced")
    try:
        place.rename(aside)
        written.rename(place)
    except BaseException:
        if aside.exists() and not place.exists():
            aside.rename(place)
        raise
