"""Workbench: what the shots of a run share, so that each finds plan, references and memory ready."""

from collections.abc import Callable, Hashable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from threading import Lock
from typing import Any, Generic, TypeVar

from daq.files.run_directory import RunReader
from daq.files.run_file import RUN_FILE
from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity
from processing.reconstruction.reconstructor import Reconstructor

References = Mapping[str, tuple[Intensity | None, Intensity | None]]
Made = TypeVar("Made")


def read_references(run: RunReader) -> References:
    """Dark and background (exposures, rows, columns) of every view, None where there is none.

    To unpack them takes longer than to reconstruct a shot, and nothing else can begin: several views at once.
    """
    views = list(run.header.views)
    with ThreadPoolExecutor(DEFAULT_THREADS, "references") as pool:
        return dict(zip(views, pool.map(lambda view: (run.dark(view), run.background(view)), views), strict=True))


class Latest(Generic[Made]):
    """What was asked for last: so many things, of which the one that nobody asks for any more makes room.

    Parameters
    ----------
    most : int
        As many are kept.
    """

    def __init__(self, most: int = 1) -> None:
        self._most = most
        self._made: dict[Hashable, Made] = {}

    def of(self, key: Hashable, make: Callable[[], Made]) -> Made:
        """What stands for the key, made now if it is not there."""
        if key not in self._made:
            while len(self._made) >= self._most:  # first, so that its memory is free
                del self._made[next(iter(self._made))]
        made = self._made.pop(key) if key in self._made else make()
        self._made[key] = made
        return made

    def known(self, key: Hashable) -> Made | None:
        """What stands for the key, if it is there; it takes no room of others."""
        return self._made.get(key)


class Workbench:
    """Keeps the latest plan with its memory, and the latest references and plan of a run. Serves one shot at a time.

    A thread that comes while another one works at it waits; threads that work side by side have one each.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._references: Latest[References] = Latest()
        self._planned: Latest[Any] = Latest()
        self._reconstructors: Latest[tuple[Reconstructor, ...]] = Latest()

    @contextmanager
    def occupied(self) -> Iterator["Workbench"]:
        """Have it for oneself."""
        with self._lock:
            yield self

    def references(self, run: RunReader) -> References:
        """References of a run, read again when its file has changed."""
        return self._references.of(_content(run), lambda: read_references(run))

    def planned(self, run: RunReader, key: Hashable, make: Callable[[], Made]) -> Made:
        """What was planned for a run and all that the key names; planned anew when the file of the run has changed."""
        plan: Made = self._planned.of((_content(run), key), make)
        return plan

    def reconstructors(self, key: Hashable, make: Callable[[], tuple[Reconstructor, ...]]) -> tuple[Reconstructor, ...]:
        """The reconstructors for all that the key names, which share its plan."""
        return self._reconstructors.of(key, make)


def _content(run: RunReader) -> Hashable:
    return run.run_dir, (run.run_dir / RUN_FILE).stat().st_mtime_ns
