"""Tasks that tests give to workers of other processes."""

import os
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

STEP_S = 0.05


def write_slowly(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    """Take some steps, then write one file; every beginning is noted, with the process."""
    out = Path(job["results_dir"])
    (out / f"{job['shot']}.begun.{os.getpid()}").touch()
    for _ in range(job["steps"]):
        if should_stop():
            return {}
        threading.Event().wait(STEP_S)
    (out / f"{job['shot']}.done").touch()
    return {"shot": job["shot"], "threads": job.get("threads")}


def tell_modules(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    """What a worker has loaded."""
    return {"modules": sorted(sys.modules), "niceness": os.nice(0), "threads": job["threads"]}
