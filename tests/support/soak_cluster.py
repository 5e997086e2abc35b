"""Kill and cut off parts of a cluster while it works, and count shots: ``make soak PART=cluster TIMES=rounds``.

Every round has every fault once, at a random moment of a batch of shots. A shot is lost that has no result, or none on
the disk; a batch that does not come to its end is lost as a whole.
"""

import os
import platform
import random
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from server.cli.output import endable, table
from server.lab.engine.cluster_engine import ClusterEngine
from server.lab.engine.in_order import results_in_order
from server.lab.engine.task import Values
from server.rig.processing_config import ProcessingConfig
from tests.support.cluster import Cluster, FarNetwork, cluster, far_network, write_certificates
from tests.support.cluster_tasks import write_slowly
from tests.support.server_process import LIMIT_S, eventually

SHOTS, STEPS = 16, 10
CUT_S = (1.0, 20.0)
"""A connection lives for 12 s without its cable."""


class Batch:
    """Slow shots under way in a thread, as a command does them."""

    def __init__(self, config: ProcessingConfig, out: Path, shots: int, steps: int = STEPS) -> None:
        out.mkdir()
        self.out, self.shots = out, list(range(shots))
        jobs = {f"run, shot {shot}": {"results_dir": str(out), "shot": shot, "steps": steps} for shot in self.shots}
        self._results: Future[list[dict[str, Any]]] = Future()
        threading.Thread(target=self._work, args=(config, jobs), daemon=True).start()

    def _work(self, config: ProcessingConfig, jobs: Mapping[str, Values]) -> None:
        """Thread: one that never ends holds up no test."""
        try:
            self._results.set_result(list(results_in_order(ClusterEngine(config), write_slowly, jobs)))
        except Exception as error:  # noqa: BLE001  told where the results are asked for
            self._results.set_exception(error)

    def await_begun(self, count: int) -> list[int]:
        """Wait until so many shots have begun; the processes that do them, the latest last."""
        eventually(lambda: self._results.done() or len(self.begun()) >= count, f"{count} shots have begun")
        assert not self._results.done(), f"all is over: {self._results.exception()}"
        return [int(path.suffix[1:]) for path in self.begun()]

    def lost(self) -> int:
        """Wait for the end; shots without result or file, or whose result came twice."""
        results = [result["shot"] for result in self._results.result(LIMIT_S)]
        on_disk = {int(path.stem) for path in self.out.glob("*.done")}
        return sum(results.count(shot) != 1 or shot not in on_disk for shot in self.shots)

    def begun(self) -> list[Path]:
        """A file for every beginning of a shot."""
        return sorted(self.out.glob("*.begun.*"), key=lambda path: path.stat().st_mtime_ns)


@dataclass(frozen=True)
class Fault:
    """What befell a batch.

    Parameters
    ----------
    name : str
        The fault; empty: none, for comparison.
    lost, again : int
        Shots that were lost, and beginnings of shots that had begun before.
    wall_s : float
        From the first request to the last result.
    load : float
        Of the machine, over a minute.
    """

    name: str
    lost: int
    again: int
    wall_s: float
    load: float


def _none(lab: Cluster, far: FarNetwork, batch: Batch) -> None:
    """Nothing happens."""


def kill_working(lab: Cluster, far: FarNetwork, batch: Batch) -> None:
    """The process that began the latest shot."""
    with suppress(ProcessLookupError):
        os.kill(batch.await_begun(1)[-1], 9)


def kill_worker(lab: Cluster, far: FarNetwork, batch: Batch) -> None:
    """A worker with the process that would start it again; somebody starts it anew."""
    lab.kill("worker0")
    lab.start_worker("worker0")


def kill_scheduler(lab: Cluster, far: FarNetwork, batch: Batch) -> None:
    """Somebody starts it anew."""
    lab.kill("scheduler")
    lab.start_scheduler()


def cut_cable(lab: Cluster, far: FarNetwork, batch: Batch) -> None:
    """Of the other worker, for a while."""
    far.cut()
    time.sleep(random.uniform(*CUT_S))
    far.mend()


FAULTS: Mapping[str, Callable[[Cluster, FarNetwork, Batch], None]] = MappingProxyType(
    {
        "": _none,
        "process of a worker killed": kill_working,
        "worker killed, started again": kill_worker,
        "scheduler killed, started again": kill_scheduler,
        "cable of a worker out for 1 to 20 s": cut_cable,
    }
)


def befall(folder: Path, rounds: int, tell: Callable[[Fault], None]) -> None:
    """Every fault so many times."""
    certificates = write_certificates(folder / "ca")
    with far_network() as far, cluster(folder / "lab", certificates, workers=1, host=far.near_ip) as lab:
        lab.start_worker("far", far.enter)
        lab.await_word("far", "works for")
        for number in range(rounds):
            for name, happen in FAULTS.items():
                began_s = time.monotonic()
                batch = Batch(lab.config(), folder / f"{number}-{name}", SHOTS)
                batch.await_begun(1)
                threading.Event().wait(random.uniform(0, SHOTS * STEPS * 0.05 / 4))
                happen(lab, far, batch)
                lost, wall_s = batch.lost(), time.monotonic() - began_s
                tell(Fault(name, lost, len(batch.begun()) - SHOTS, wall_s, os.getloadavg()[0]))


def summary(faults: Sequence[Fault]) -> str:
    """A row per fault."""
    rows = []
    for name in FAULTS:
        some = [one for one in faults if one.name == name]
        counts = (len(some), SHOTS * len(some), sum(one.lost for one in some), sum(one.again for one in some))
        rows.append([name or "(none)", *map(str, counts), f"{max((one.wall_s for one in some), default=0):.1f}"])
    heads = ["what happens", "times", "shots", "lost", "begun again", "longest s"]
    loads = f"load {min(one.load for one in faults):.1f} to {max(one.load for one in faults):.1f}"
    return f"{table(heads, rows)}\n{os.cpu_count()} cores, {platform.machine()}, Linux {platform.release()}, {loads}"


def main() -> int:
    """Print the table for so many rounds."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], capture_output=True, text=True, check=False)
    faults: list[Fault] = []

    def keep(fault: Fault) -> None:
        faults.append(fault)
        sys.stderr.write(f"{fault}\n")

    with suppress(KeyboardInterrupt), endable(), tempfile.TemporaryDirectory() as folder:
        befall(Path(folder), rounds, keep)
    sys.stdout.write(f"{summary(faults)}\ncommit {commit.stdout.strip()}\n" if faults else "nothing has happened\n")
    return int(any(fault.lost for fault in faults))


if __name__ == "__main__":
    sys.exit(main())
