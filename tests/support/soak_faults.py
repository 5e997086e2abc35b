"""Let devices of a simulated rig be lost between runs and come back, and time the next run: ``make soak PART=faults``.

Nobody starts the server anew, and nobody helps but by acknowledging a fault of the generator, as an operator would.
"""

import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from server.cli.output import table
from tests.support.simulated_serving import CURRENT_A, BenchServing, eventually, serving_bench, tiny_config

AWAY_S = 3.0
"""So long a device is away: longer than its lamp takes to notice."""
AGAIN_S = 0.5
"""After a refusal an operator reads it before the next try."""
FAULTS: Mapping[str, Mapping[str, Any]] = {
    "frozen": {"view": "view2"},
    "killed": {"view": "view2"},
    "control_taken": {"view": "view2"},
    "generator_unplugged": {},
    "generator_hang": {},
    "stage_unplugged": {},
}
PLAN = {"name": "soak", "kind": "background", "shots": 2, "rate_hz": 10.0, "pulse": {"current_a": CURRENT_A}}


@dataclass(frozen=True)
class Returned:
    """A device that was lost and came back.

    Parameters
    ----------
    fault : str
        What had happened to it; empty: nothing, for comparison.
    next_run_s : float
        From its return to the end of the first run that was completed.
    refused, failed : int
        Starts that were refused, and runs that failed, before that.
    load : float
        Of the machine, over a minute.
    """

    fault: str
    next_run_s: float
    refused: int
    failed: int
    load: float


def next_run(bench: BenchServing, fault: str) -> Returned:
    """Ask for runs until one is completed."""
    began_s, answers, failed = time.monotonic(), [0], [0]

    def completed() -> bool:
        bench.http.post("/api/rig/acknowledge")
        answers[0] += 1
        if answers[0] > 1:
            time.sleep(AGAIN_S)
        if bench.http.post("/api/runs", json=PLAN).status_code != 201:
            return False
        status = bench.end()
        failed[0] += status.outcome != "completed"
        return status.outcome == "completed"

    eventually(completed, lambda: f"after {fault} no run is completed: {bench.acquisition.status().message}")
    refused = answers[0] - 1 - failed[0]
    return Returned(fault, time.monotonic() - began_s, refused, failed[0], round(os.getloadavg()[0], 1))


def lose_devices(bench: BenchServing, trials: int) -> list[Returned]:
    """Every fault so many times, each after a run without one."""
    found = []
    for _ in range(trials):
        for fault, fields in FAULTS.items():
            found.append(next_run(bench, ""))
            with bench.during(fault, **fields):
                time.sleep(AWAY_S)
            found.append(next_run(bench, fault))
    return found


def summary(found: Sequence[Returned]) -> str:
    """A row per fault."""
    rows = []
    for fault in ("", *FAULTS):
        some = [one for one in found if one.fault == fault]
        times_s = [one.next_run_s for one in some]
        counts = (sum(one.refused for one in some), sum(one.failed for one in some))
        times = (f"{statistics.median(times_s):.1f}", f"{max(times_s):.1f}")
        rows.append([fault or "(none)", str(len(some)), *times, *map(str, counts)])
    heads = ["lost between runs", "times", "back to end of next run s, median", "longest", "refused", "failed"]
    loads = f"load {min(one.load for one in found):g} to {max(one.load for one in found):g}"
    return f"{table(heads, rows)}\n{os.cpu_count()} cores, {platform.machine()}, Linux {platform.release()}, {loads}"


def main() -> int:
    """Print the table; how often each fault happens is the first argument."""
    trials = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], capture_output=True, text=True, check=False)
    with tempfile.TemporaryDirectory() as folder, serving_bench(tiny_config(Path(folder) / "runs", subnet=9)) as bench:
        sys.stdout.write(f"{summary(lose_devices(bench, trials))}\ncommit {commit.stdout.strip()}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
