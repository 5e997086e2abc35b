"""Workbench: what the shots of a run share, so that each finds plan, references and memory ready."""

from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import contextmanager
from threading import Lock
from typing import Generic, TypeVar

from daq.files.run_directory import RunReader
from daq.files.run_file import RUN_FILE
from processing.preprocessing import Intensity
from processing.reconstruction.reconstructor import Reconstructor

References = Mapping[str, tuple[Intensity | None, Intensity | None]]
Made = TypeVar("Made")


def read_references(run: RunReader) -> References:
    """Dark and background (exposures, rows, columns) of every view, None where there is none.

    To unpack them takes longer than to reconstruct a shot.
    """
    return {view: (run.dark(view), run.background(view)) for view in run.header.views}


class _Latest(Generic[Made]):
    """What was made last, for as long as the same is asked for."""

    def __init__(self) -> None:
        self._made: tuple[Hashable, Made] | None = None

    def of(self, key: Hashable, make: Callable[[], Made]) -> Made:
        if self._made is None or self._made[0] != key:
            self._made = None  # so that its memory is free before the next one is made
            self._made = (key, make())
        return self._made[1]


class Workbench:
    """Keeps the latest plan with its memory, and the latest references. Serves one shot at a time.

    A thread that comes while another one works at it waits; threads that work side by side have one each.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._references: _Latest[References] = _Latest()
        self._reconstructor: _Latest[Reconstructor] = _Latest()

    @contextmanager
    def occupied(self) -> Iterator["Workbench"]:
        """Have it for oneself."""
        with self._lock:
            yield self

    def references(self, run: RunReader) -> References:
        """References of a run, read again when its file has changed."""
        written_ns = (run.run_dir / RUN_FILE).stat().st_mtime_ns
        return self._references.of((run.run_dir, written_ns), lambda: read_references(run))

    def reconstructor(self, key: Hashable, make: Callable[[], Reconstructor]) -> Reconstructor:
        """The reconstructor for all that the key names."""
        return self._reconstructor.of(key, make)
