"""What commands say: progress while they work, and at the end an object for programs and a text for people."""

import json
import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TextIO


@dataclass(frozen=True)
class Outcome:
    """What a command has found.

    Parameters
    ----------
    result : dict[str, Any]
        JSON values, for programs; ``passed: False`` among them makes the command fail.
    text : str
        The same for people.
    """

    result: dict[str, Any]
    text: str = ""

    @property
    def passed(self) -> bool:
        """Whether the command may end with exit status 0."""
        return bool(self.result.get("passed", True))


def tell(outcome: Outcome, as_json: bool) -> None:
    """Print the text; where a program listens, it goes to stderr, and the object is the last line of stdout."""
    if outcome.text:
        say(outcome.text, sys.stderr if as_json else sys.stdout)
    if as_json:
        say(json.dumps(outcome.result), sys.stdout)


def progress(text: str) -> None:
    """Tell the user what happens, on stderr."""
    say(text, sys.stderr)


def say(text: str, stream: TextIO, end: str = "\n") -> None:
    """Print at once. A reader who has seen enough, as ``| head``, ends neither the work nor in a traceback."""
    try:
        print(text, end=end, file=stream, flush=True)
    except BrokenPipeError:
        with open(os.devnull, "w") as nowhere:
            os.dup2(nowhere.fileno(), stream.fileno())


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Columns as wide as they must be; words to the left, figures to the right."""
    lines = [tuple(heads), *map(tuple, rows)]
    columns = [_column(cells) for cells in zip(*lines, strict=True)]
    return "\n".join("  ".join(cells).rstrip() for cells in zip(*columns, strict=True))


def _column(cells: Sequence[str]) -> list[str]:
    width = max(map(len, cells))
    figures = all(map(_is_figure, cells[1:]))
    return [cell.rjust(width) if figures else cell.ljust(width) for cell in cells]


def _is_figure(cell: str) -> bool:
    try:
        float(cell or 0)
    except ValueError:
        return False
    return True
