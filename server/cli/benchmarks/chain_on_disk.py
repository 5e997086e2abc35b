"""From a run on disk to what is looked at: previews of every exposure, a mean, a job of the server."""

import asyncio
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from processing.benchmarks import targets
from processing.benchmarks.scene import SpeedStudy
from processing.benchmarks.targets import Measured
from processing.runs.pipeline import reconstruct_shots
from server.cli.benchmarks.recorded_run import RecordedRun, record_run
from server.cli.benchmarks.whole_command import cost_of
from server.lab.engine.dask_engine import DaskEngine
from server.lab.results import keep_preview
from server.lab.tasks import reconstruct

SHOTS = 8


def chain_on_disk(study: SpeedStudy, directory: Path | None, shots: int = SHOTS) -> Iterator[Measured]:
    """Measure one after the other, with a run in ``directory``."""
    with TemporaryDirectory(dir=directory) as folder:
        run = record_run(Path(folder), study, shots)
        yield from _previews(run, Path(folder) / "previews", study.threads)
        mean = ["-o", str(Path(folder) / "mean.vtkhdf"), run.grid_option]
        cost = cost_of(["average", str(run.run_dir), "--calibration", str(run.calibration_file), *mean])
        yield Measured(targets.AVERAGE_CPU, cost.cpu_s, how=f"{shots} shots")
        yield Measured(targets.AVERAGE_MEMORY, cost.peak_gb, how=f"{shots} shots")
        added_s = asyncio.run(_added_by_jobs(run, Path(folder) / "jobs"))
        yield Measured(targets.JOB, median(added_s), how=f"median of {len(added_s)}")


def _previews(run: RecordedRun, out: Path, threads: int) -> Iterator[Measured]:
    shots, calibration = range(run.shots), run.calibration_file
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    for _ in reconstruct_shots(run.run_dir, shots, calibration, run.settings, out, threads=threads, keep=keep_preview):
        pass
    wall_s, cpu_s = time.perf_counter() - wall_s, time.process_time() - cpu_s
    yield Measured(targets.CHAIN_CPU, cpu_s / run.shots, how=f"{run.shots} shots")
    yield Measured(targets.CHAIN_CORES, cpu_s / wall_s)


async def _added_by_jobs(run: RecordedRun, out: Path) -> list[float]:
    """What lies between asking for a shot and having it, but for the work; the first one warms up."""
    added_s = []
    async with DaskEngine(modules=[__name__]) as engine:
        for shot in range(run.shots):
            job = {
                "run_dir": str(run.run_dir),
                "shot": shot,
                "calibration_file": str(run.calibration_file),
                "results_dir": str(out),
                "settings": run.settings.model_dump(mode="json"),
            }
            asked_s = time.perf_counter()
            told = await engine.submit(f"shot {shot}", _clocked, job, _ignore)
            added_s.append(time.perf_counter() - asked_s - told["work_s"])
    return added_s[1:]


def _clocked(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    begun_s = time.perf_counter()
    reconstruct(job, should_stop)
    return {"work_s": time.perf_counter() - begun_s}


def _ignore(_steps: int) -> None:
    """Nobody waits for progress."""
