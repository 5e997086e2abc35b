"""Record thousands of shots through one server, and see what is lost and what its memory does: ``make soak PART=long``.

The far ends of the rig run in a process of their own, so that the memory is the server's alone; every image tells
firing, view and exposure. Each run is compared with the disk, then removed. Results are added to a file: a soak that
was interrupted goes on where it was, at the same commit, with a new server.
"""

import json
import os
import platform
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from daq.files.run_directory import RunReader
from server.cli.output import endable, table
from server.rig.config import RigConfig, load_config
from tests.support.server_process import ENVIRONMENT, ServerProcess, eventually, stopped_at_end
from tests.support.soak_kill import ROOT, mispaired_exposures, readable, write_rig

SHOTS, RATE_HZ = 500, 10.0
WARM_SHOTS = 2500
"""Before them memory grows by what is kept and bounded, such as the last 2,000 events."""
_LONGEST_S = 600.0


@dataclass(frozen=True)
class Recorded:
    """One run.

    Parameters
    ----------
    commit : str
        What was tried.
    server : int
        Process id: memory is compared within one server.
    planned, told, valid : int
        Shots that were asked for, and those that the server told as recorded, and as valid.
    lost, mispaired : int
        Shots that were told and cannot be read, and exposures that are none of what they stand for.
    rss_kib : tuple[tuple[int, float], ...]
        Shots of this server so far, and its memory then; all of them while it records, as its buffers go afterwards.
    load : float
        Of the machine, over a minute.
    """

    commit: str
    server: int
    planned: int
    told: int
    valid: int
    lost: int
    mispaired: int
    rss_kib: tuple[tuple[int, float], ...]
    load: float


def record_runs(shots: int, work_dir: Path, commit: str, tell: Callable[[Recorded], None]) -> None:
    """Record so many shots, run by run, with one server, and tell of each run."""
    config = write_rig(work_dir)
    simulate = [sys.executable, "-m", "server.cli", "simulate", "--config", str(config)]
    with stopped_at_end(subprocess.Popen(simulate, cwd=work_dir, env=ENVIRONMENT)):
        server = ServerProcess(work_dir, config)
        try:
            eventually(server.answers, "the server answers")
            before = 0
            while before < shots:
                run = _record(
                    server, load_config(config), work_dir / "runs", min(SHOTS, shots - before), before, commit
                )
                before += run.planned
                tell(run)
        finally:
            server.kill()
            server.http.close()


def slope_bytes(runs: Sequence[Recorded]) -> float | None:
    """By how much the memory of the server grows with every shot, of the one that recorded most; None: not known."""
    servers = {run.server for run in runs}
    samples = max(
        ([s for run in runs if run.server == one for s in run.rss_kib] for one in servers), key=len, default=[]
    )
    warm = np.array([sample for sample in samples if sample[0] >= WARM_SHOTS], float)
    if len(warm) < 3 or np.ptp(warm[:, 0]) == 0:
        return None
    return float(np.polyfit(warm[:, 0], 1024 * warm[:, 1], 1)[0])


def summary(runs: Sequence[Recorded]) -> str:
    """The table of all runs."""
    slope = slope_bytes(runs)
    row = [
        str(len(runs)),
        *(str(sum(getattr(run, name) for run in runs)) for name in ("planned", "told", "valid", "lost", "mispaired")),
        "-" if slope is None else f"{slope:.0f}",
        f"{max(rss for run in runs for _, rss in run.rss_kib) / 1024:.0f}",
        f"{min(run.load for run in runs):g} to {max(run.load for run in runs):g}",
    ]
    heads = ["runs", "shots", "told", "valid", "lost", "mispaired", "RSS B per shot", "most MiB", "load"]
    machine = f"{os.cpu_count()} cores, {platform.machine()}, Linux {platform.release()}"
    return f"{table(heads, [row])}\ncommit {runs[0].commit}; {machine}"


def _record(server: ServerProcess, config: RigConfig, runs: Path, shots: int, before: int, commit: str) -> Recorded:
    current_a = {name: view.nominal_current_a for name, view in config.views.items()}
    plan = {"name": "long", "kind": "background", "shots": shots, "rate_hz": RATE_HZ, "pulse": {"current_a": current_a}}
    answer = server.http.post("/api/runs", json=plan)
    if answer.status_code != 201:
        raise RuntimeError(f"the run is refused: {answer.text}")
    url, samples, end_s = answer.headers["location"], [], time.monotonic() + _LONGEST_S
    while (told := server.http.get(url).json())["outcome"] == "active":
        samples.append((before + told["shots_recorded"], server.rss_kib))
        if time.monotonic() > end_s:
            raise RuntimeError(f"{url} has not ended after {_LONGEST_S:g} s: {told}")
        time.sleep(1.0)
    reader = RunReader(runs / told["run_id"])
    lost = mispaired = 0
    for index in range(told["shots_recorded"]):
        shot = readable(reader, index)
        lost += shot is None
        mispaired += 0 if shot is None else mispaired_exposures(shot, list(config.views))
    shutil.rmtree(reader.run_dir)
    counts = (told["shots_recorded"], told["shots_valid"], lost, mispaired)
    return Recorded(commit, server.pid, shots, *counts, tuple(samples), round(os.getloadavg()[0], 1))


def main() -> int:
    """Go on until there are so many shots of this commit."""
    wanted = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    work_dir = ROOT / "build" / "soak_long"
    work_dir.mkdir(parents=True, exist_ok=True)
    results = work_dir / "long.jsonl"
    said = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True)
    commit = said.stdout.strip()
    runs = [run for run in _read(results) if run.commit == commit]

    def keep(run: Recorded) -> None:
        runs.append(run)
        with results.open("a") as file:
            file.write(json.dumps(asdict(run)) + "\n")
        sys.stderr.write(f"{sum(one.planned for one in runs)} of {wanted}: {run.told} told, {run.lost} lost\n")

    with suppress(KeyboardInterrupt), endable():
        record_runs(max(0, wanted - sum(run.planned for run in runs)), work_dir, commit, keep)
    sys.stdout.write(summary(runs) + "\n" if runs else "nothing was recorded\n")
    return int(any(run.lost or run.mispaired or run.told < run.planned for run in runs))


def _read(results: Path) -> Iterator[Recorded]:
    if results.exists():
        for line in results.read_text().splitlines():
            kept = json.loads(line)
            yield Recorded(**kept | {"rss_kib": tuple(map(tuple, kept["rss_kib"]))})


if __name__ == "__main__":
    sys.exit(main())
