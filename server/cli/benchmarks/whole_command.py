"""CPU time and peak memory of a whole command, in a process of its own."""

import json
import runpy
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

DEADLINE_S = 600.0


@dataclass(frozen=True)
class CommandCost:
    """From the first import to the end."""

    cpu_s: float
    peak_gb: float


def cost_of(arguments: Sequence[str]) -> CommandCost:
    """Run a command of tomoshadow; CalledProcessError if it fails."""
    command = [sys.executable, "-m", __name__, *arguments]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, timeout=DEADLINE_S)
    return CommandCost(**json.loads(done.stdout.splitlines()[-1]))


def _measured(arguments: Sequence[str]) -> None:
    sys.argv[1:] = arguments
    try:
        runpy.run_module("server.cli", run_name="__main__")
    finally:
        lines = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
        peak_gb = int(lines["VmHWM"].split()[0]) * 1024 / 1e9
        sys.stdout.write("\n" + json.dumps({"cpu_s": time.process_time(), "peak_gb": peak_gb}) + "\n")


if __name__ == "__main__":
    _measured(sys.argv[1:])
