"""From a run on disk to what is looked at: previews of every exposure, a mean, slices, a job of the server."""

import asyncio
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

from daq.counted import counted
from processing.benchmarks import targets
from processing.benchmarks.baseline import Timing, measure_once
from processing.benchmarks.targets import Measured
from processing.runs.results_file import FrameName
from processing.runs.volumes.pipeline import reconstruct_shots
from processing.runs.volumes.volume_parts import Recipe, VolumeParts
from server.cli.benchmarks.recorded_run import RecordedRun
from server.cli.benchmarks.whole_command import cost_of
from server.lab.engine.dask_engine import DaskEngine
from server.lab.results import keep_preview
from server.lab.tasks import reconstruct

SHOTS = 8
_FRAMES: tuple[FrameName, ...] = ("a", "b")


def previews(run: RecordedRun, folder: Path, threads: int) -> Iterator[Measured]:
    """Previews of every exposure, which a server would keep."""
    shots, calibration, out = range(run.shots), run.calibration_file, folder / "previews"
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    for _ in reconstruct_shots(run.run_dir, shots, calibration, run.settings, out, threads=threads, keep=keep_preview):
        pass
    wall_s, cpu_s = time.perf_counter() - wall_s, time.process_time() - cpu_s
    yield Measured(targets.CHAIN_CPU, cpu_s / run.shots, how=counted(run.shots, "shot"))
    yield Measured(targets.CHAIN_CORES, cpu_s / wall_s)


def average(run: RecordedRun, folder: Path, _threads: int) -> Iterator[Measured]:
    """The command, from its first import to its end."""
    mean = ["-o", str(folder / "mean.vtkhdf"), "--overwrite", run.grid_option]
    cost = cost_of(["average", str(run.run_dir), "--calibration", str(run.calibration_file), *mean])
    yield Measured(targets.AVERAGE_CPU, cost.cpu_s, how=counted(run.shots, "shot"))
    yield Measured(targets.AVERAGE_MEMORY, cost.peak_gb, how=counted(run.shots, "shot"))


def slices(run: RecordedRun, _folder: Path, threads: int) -> Iterator[Measured]:
    """Slices across each axis, of one exposure after the other."""
    parts = VolumeParts(threads)
    middle = {axis: (0.0, 0.0) for axis in "xyz"}

    def look(shot: int, frame: FrameName) -> list[Timing]:
        recipe = Recipe(run.run_dir, shot, frame, run.calibration_file, run.settings, {})
        method = run.settings.method
        return [measure_once(partial(parts.seen, recipe, {axis: span}, method)) for axis, span in middle.items()]

    exposures = [look(shot, frame) for shot in range(run.shots) for frame in _FRAMES]
    first, later = [each[0] for each in exposures[1:]], [one for each in exposures for one in each[1:]]
    for target, timings in ((targets.FIRST_SLICE, first), (targets.FULL_SLICE, later)):
        typical = Timing(median(one.wall_s for one in timings), median(one.cpu_s for one in timings))
        yield Measured(target, 1e3 * typical.wall_s, typical)


def jobs(run: RecordedRun, folder: Path, _threads: int) -> Iterator[Measured]:
    """What the server's engine adds to a job."""
    added_s = asyncio.run(_added_by_jobs(run, folder / "jobs"))
    yield Measured(targets.JOB, median(added_s), how=f"median of {len(added_s)}")


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
