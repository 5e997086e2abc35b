"""What runs in a worker process of Dask: an errand, which asks and tells by the scheduler."""

# mypy: allow-untyped-calls
# distributed is typed in parts only.

import os
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

import cv2
from distributed import Event, WorkerPlugin, get_worker

from server.lab.engine.task import StopSignal, Task, TaskError, Values, perform

PROGRESS_TOPIC = "tomoshadow-progress"
THREADS_VARIABLE = "TOMOSHADOW_THREADS"
"""Of the environment of a worker: threads of its kernels."""
SEEN_S = 5.0
"""A network file system shows others a new folder after a while."""


@dataclass(frozen=True)
class Errand:
    """A job on its way to a worker.

    Parameters
    ----------
    name : str
        Of all errands of a scheduler, whoever sent them, it alone is called so.
    job : mapping
        What the task gets; JSON values.
    version : str
        Of tomoshadow; a worker of another one refuses. Empty: a worker of this computer, nothing is asked.
    seen : mapping
        Folders that the worker must see, and what they are called at home.
    """

    name: str
    job: Values
    version: str = ""
    seen: Mapping[str, str] = field(default_factory=dict)


def perform_errand(task: Task, errand: Errand) -> dict[str, Any] | None:
    """Run a task in this worker; None if it was aborted.

    Raises
    ------
    TaskError
        This is not the worker for it: it has another version, or does not see the files.
    """
    worker, asked = get_worker(), Event(abort_event(errand.name))
    if errand.version:
        _require_version(worker.address, errand.version)
    _require_seen(worker.address, errand.seen)
    threads = {"threads": int(os.environ[THREADS_VARIABLE])} if THREADS_VARIABLE in os.environ else {}
    stop = StopSignal(asked.is_set, lambda steps: worker.log_event(PROGRESS_TOPIC, {errand.name: steps}))
    return perform(task, {**errand.job, **threads}, stop)


def abort_event(name: str) -> str:
    """Name of the event that ends an errand."""
    return f"abort {name}"


def _require_version(worker: str, wanted: str) -> None:
    found = version("tomoshadow")
    if found != wanted:
        raise TaskError(
            f"worker {worker} has tomoshadow {found}, not {wanted}: install {wanted} there, and start it again"
        )


def _require_seen(worker: str, folders: Mapping[str, str]) -> None:
    deadline_s = time.monotonic() + SEEN_S
    for there, here in folders.items():
        while not Path(there).is_dir():
            if time.monotonic() >= deadline_s:
                raise TaskError(
                    f"worker {worker} sees no folder {there} within {SEEN_S:g} s, which is {here} here: mount it "
                    f"there, or say what it is called there ([processing.paths] in the rig file, --path in a command)"
                )
            threading.Event().wait(SEEN_S / 20)


class Prepared(WorkerPlugin):
    """Workers use one thread of OpenCV, and load what tasks will need while they wait for the first.

    Parameters
    ----------
    modules : sequence of str
        To load them takes longer than a shot does.
    niceness : int
        Workers give way to acquisition and server, where those run beside them.
    """

    def __init__(self, modules: Sequence[str], niceness: int = 0) -> None:
        self._modules = modules
        self._niceness = niceness

    def setup(self, worker: object) -> None:  # noqa: ARG002 - signature of distributed
        """Called by the worker, once it has started."""
        os.nice(self._niceness)
        cv2.setNumThreads(1)
        threading.Thread(target=_load, args=(self._modules,), name="load tasks", daemon=True).start()


def _load(modules: Sequence[str]) -> None:
    for module in modules:
        import_module(module)
