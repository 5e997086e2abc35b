"""What commands say: progress while they work, and at the end an object for programs and a text for people.

Between the steps of progress they hear who wants them to end.
"""

import json
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from shutil import get_terminal_size
from time import monotonic
from types import FrameType
from typing import Any, Self, TextIO, TypeVar

T = TypeVar("T")
BAR_WIDTH = 24
_CLEAR_LINE = "\r\x1b[K"
_ENDED = threading.Event()


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


@contextmanager
def endable() -> Iterator[None]:
    """Let SIGINT and SIGTERM end the block by a KeyboardInterrupt; a second one ends the process at once.

    Python drops what a handler raises within ``__del__`` or a weakref callback: ``heed`` makes up for that.
    """
    main = threading.current_thread() is threading.main_thread()
    heard = [
        number for number in (signal.SIGINT, signal.SIGTERM) if main and signal.getsignal(number) != signal.SIG_IGN
    ]
    before = {number: signal.signal(number, _end) for number in heard}
    try:
        yield
    finally:
        _ENDED.clear()
        for number, handler in before.items():
            signal.signal(number, handler)


def _end(number: int, _frame: FrameType | None) -> None:
    _ENDED.set()
    signal.signal(number, signal.SIG_DFL)
    raise KeyboardInterrupt(signal.Signals(number).name)


def heed() -> None:
    """End here, between two steps, if the process was told to end and nothing came of it."""
    if _ENDED.is_set():
        raise KeyboardInterrupt


def progress(text: str) -> None:
    """Tell the user what happens, on stderr; on a terminal in place of a bar, which its next step draws again."""
    say(f"{_CLEAR_LINE}{text}" if sys.stderr.isatty() else text, sys.stderr)


class Bar:
    """How far a long command is: a bar on a terminal, elsewhere a line per step.

    Parameters
    ----------
    clock : callable
        Seconds; tells how long the rest will take.
    """

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        self._clock = clock
        self._started_s = clock()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if sys.stderr.isatty():
            say(_CLEAR_LINE, sys.stderr, end="")

    def step(self, done: int, total: int, text: str = "") -> None:
        """Show that so many of so many are done; the text says of what, and is the line where there is no terminal."""
        heed()
        if not sys.stderr.isatty():
            if text:
                say(text, sys.stderr)
            return
        filled = BAR_WIDTH * done // max(total, 1)
        line = f"[{'#' * filled}{'.' * (BAR_WIDTH - filled)}] {done}/{total}{self._left(done, total)}  {text}"
        say(_CLEAR_LINE + line[: get_terminal_size().columns - 1], sys.stderr, end="")

    def _left(self, done: int, total: int) -> str:
        if not 0 < done < total:
            return ""
        minutes, seconds = divmod(round((self._clock() - self._started_s) * (total - done) / done), 60)
        return f", {minutes}:{seconds:02d} left"


def tracked(items: Sequence[T], text: Callable[[T], str] = lambda _: "") -> Iterator[T]:
    """Items one by one with a bar that says, before each, what is done with it."""
    with Bar() as bar:
        for done, item in enumerate(items):
            bar.step(done, len(items), text(item))
            yield item


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


def train_table(views: dict[str, Any]) -> str:
    """A line per view with what was loaded, for people."""
    rows = [
        [
            name,
            *("{} to {}".format(*view["actual"][key]) for key in ("pulse_a_ns", "pulse_b_ns")),
            *(str(view["actual"][key]) for key in ("separation_ns", "guard_before_ns", "guard_after_ns")),
            f"{view['actual']['current_a']:g}",
        ]
        for name, view in views.items()
    ]
    heads = [
        "view",
        "pulse A [ns]",
        "pulse B [ns]",
        "separation [ns]",
        "guard before [ns]",
        "after [ns]",
        "current [A]",
    ]
    return table(heads, rows)
