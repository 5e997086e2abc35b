"""Two workers in two networks, one processor each, do full frames: ``make soak PART=workers TIMES=shots``.

A few sprays are in all shots, beside another one each time: to draw them all takes longer than to reconstruct them.
Prints how busy the processors were with shots, how much quicker two are than one, and whether all volumes are those
that two processes make by themselves, bit by bit.
"""

import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from daq.files.run_directory import RunReader
from processing.benchmarks.scene import SpeedStudy
from processing.reconstruction.settings import ReconstructionSettings
from processing.reconstruction.volume_file import open_volume
from processing.runs.volumes.pipeline import reconstruct_shots
from server.cli.benchmarks.recorded_run import RecordedRun, record_run
from server.cli.output import endable, table
from server.lab.engine.cluster_engine import ClusterEngine
from server.lab.engine.in_order import results_in_order
from server.lab.tasks import reconstruct
from tests.support.cluster import Cluster, FarNetwork, cluster, far_network, write_certificates

WORKERS = 2
SPRAYS = 6
LIMIT_S = 1800


@dataclass(frozen=True)
class Done:
    """Shots that were done side by side.

    Parameters
    ----------
    by : str
        By whom; each has one processor.
    wall_s : float
        From the first to the last, all of them warm.
    task_cpu_s : float
        Of their processes meanwhile.
    load : float
        Of the machine, over a minute.
    """

    by: str
    wall_s: float
    task_cpu_s: float
    load: float

    @property
    def busy(self) -> float:
        """Processors that worked on shots."""
        return self.task_cpu_s / self.wall_s


def measure(folder: Path, study: SpeedStudy, shots: int, tell: Callable[[Done], None]) -> tuple[list[Done], bool]:
    """One worker, then two, then two processes that nobody gives work to; and whether all wrote the same.

    The last ones tell what a machine with other work on it has left. Each is told as soon as it is done.
    """
    run = record_run(folder, study, shots, SPRAYS)
    certificates = write_certificates(folder / "ca")
    done = []
    with ExitStack() as stack:
        networks = [stack.enter_context(far_network(number)) for number in range(1, WORKERS + 1)]
        lab = stack.enter_context(cluster(folder / "lab", certificates, workers=0, host=networks[0].near_ip))
        for number, network in enumerate(networks, 1):
            _start(lab, number, network)
            _warm_up(lab, run, folder / "warm-up", number)
            done.append(_do(lab, run, folder / f"by-{number}", number))
            tell(done[-1])
    done.append(_by_hand(run, folder / "by-hand"))
    tell(done[-1])
    same = all(_same(folder / "by-hand", folder / f"by-{number}") for number in range(1, WORKERS + 1))
    return done, same


def _start(lab: Cluster, number: int, network: FarNetwork) -> None:
    """A worker that has one processor to itself; it finds the scheduler by its own cable."""
    if number > 1:
        subprocess.run([*network.enter, "ip", "route", "add", lab.host, "via", network.near_ip], check=True)
    name = f"worker{number}"
    lab.start_worker(name, [*network.enter, "taskset", "-c", str(number - 1)])
    lab.await_word(name, f"as tls://{network.far_ip}")


def _warm_up(lab: Cluster, run: RecordedRun, out: Path, workers: int) -> None:
    """Every worker has loaded what it needs, and has planned."""
    _do(lab, run, out, workers, 2 * workers)
    shutil.rmtree(out)


def _do(lab: Cluster, run: RecordedRun, out: Path, workers: int, shots: int | None = None) -> Done:
    common = {
        "run_dir": str(run.run_dir),
        "calibration_file": str(run.calibration_file),
        "results_dir": str(out),
        "settings": run.settings.model_dump(mode="json"),
        "keep": "volume alone",
    }
    jobs = {f"shot {shot}": {**common, "shot": shot % run.shots} for shot in range(shots or run.shots)}
    began_s = time.perf_counter()
    results: list[dict[str, Any]] = list(results_in_order(ClusterEngine(lab.config()), reconstruct, jobs))
    wall_s = time.perf_counter() - began_s
    return Done(f"{workers} workers", wall_s, sum(one["cpu_s"] for one in results), os.getloadavg()[0])


def _by_hand(run: RecordedRun, out: Path) -> Done:
    """Two processes, each with its share of the shots."""
    asked = json.dumps([str(run.run_dir), str(run.calibration_file), run.settings.model_dump(mode="json"), str(out)])
    share = -(-run.shots // WORKERS)
    processes = [
        subprocess.Popen(
            ["taskset", "-c", str(number), sys.executable, "-m", __spec__.name, asked, str(first), str(first + share)],
            stdout=subprocess.PIPE,
        )
        for number, first in enumerate(range(0, run.shots, share))
    ]
    told = [json.loads(process.communicate(timeout=LIMIT_S)[0]) for process in processes]
    wall_s = max(one["ended_s"] for one in told) - min(one["began_s"] for one in told)
    return Done(f"{WORKERS} by hand", wall_s, sum(one["cpu_s"] for one in told), os.getloadavg()[0])


def _share(asked: str, first: int, last: int) -> dict[str, float]:
    run_dir, calibration_file, settings, out = json.loads(asked)
    began_s, began_cpu_s = time.time(), time.process_time()
    shots = range(first, min(last, len(RunReader(Path(run_dir)).image_keys())))
    how = ReconstructionSettings.model_validate(settings)
    for _ in reconstruct_shots(Path(run_dir), shots, Path(calibration_file), how, Path(out), threads=1):
        pass
    return {"began_s": began_s, "ended_s": time.time(), "cpu_s": time.process_time() - began_cpu_s}


def _same(here: Path, there: Path) -> bool:
    """Whether the same is read from all files: how tightly they are deflated differs by some bytes."""
    names = [sorted(path.name for path in folder.glob("*.vtkhdf")) for folder in (here, there)]
    return names[0] == names[1] and all(_reads_same(here / name, there / name) for name in names[0])


def _reads_same(here: Path, there: Path) -> bool:
    with open_volume(here) as one, open_volume(there) as other:
        slabs = zip(one.slabs(), other.slabs(), strict=True)
        return one.provenance == other.provenance and all(np.array_equal(a[1], b[1]) for a, b in slabs)


def summary(done: Sequence[Done], shots: int, same: bool) -> str:
    """A row per number of workers."""
    heads = [
        "workers",
        "double exposures",
        "wall s",
        "task CPU-s",
        "task CPU-s / wall",
        "quicker",
        "CPU-s each",
        "load",
    ]
    rows = [
        [
            one.by,
            str(shots),
            f"{one.wall_s:.1f}",
            f"{one.task_cpu_s:.1f}",
            f"{one.busy:.2f}",
            f"{done[0].wall_s / one.wall_s:.2f}",
            f"{one.task_cpu_s / shots:.2f}",
            f"{one.load:.1f}",
        ]
        for one in done
    ]
    machine = f"{os.cpu_count()} cores, {platform.machine()}, Linux {platform.release()}"
    return f"{table(heads, rows)}\nvolumes are {'' if same else 'NOT '}the same bit by bit; {machine}"


def _tell(done: Done) -> None:
    sys.stderr.write(f"{done.by}: {done.wall_s:.1f} s, {done.busy:.2f} processors busy, load {done.load:.1f}\n")


def main() -> int:
    """Print the table for so many double exposures."""
    if len(sys.argv) == 4:
        sys.stdout.write(json.dumps(_share(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))))
        return 0
    shots = int(sys.argv[1]) if len(sys.argv) > 1 else 16
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], capture_output=True, text=True, check=False)
    with tempfile.TemporaryDirectory() as folder, endable():  # 16 shots write 13 GB
        done, same = measure(Path(folder), SpeedStudy(), shots, _tell)
    sys.stdout.write(f"{summary(done, shots, same)}\ncommit {commit.stdout.strip()}\n")
    return int(not same)


if __name__ == "__main__":
    sys.exit(main())
