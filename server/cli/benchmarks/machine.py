"""What a figure was measured on: commit, processors, system, load."""

import os
import platform
import subprocess
from pathlib import Path

from processing.kernels import _native

ROOT = Path(__file__).parents[3]


def measured_on(load_before: float) -> str:
    """A sentence, for people; the load is that of the last minute."""
    system = f"{platform.system()} {'.'.join(platform.release().split('.')[:2])}"
    processors = (
        f"{len(os.sched_getaffinity(0))} of {os.cpu_count()} processors ({_processor()}, {_native.selected_isa()})"
    )
    return f"Commit {commit()}; {processors}; {system}; load {load_before:.1f} before, {os.getloadavg()[0]:.1f} after."


def commit() -> str:
    """Of the sources, and whether they were changed since; empty words where there is no repository."""
    told = subprocess.run(
        ["git", "describe", "--always", "--dirty", "--abbrev=7"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    return told.stdout.strip() or "unknown"


def _processor() -> str:
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.machine())
