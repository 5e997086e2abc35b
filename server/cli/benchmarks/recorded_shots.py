"""CPU time of a recorded shot: four simulated cameras of full size, their drivers and the recorder, in one process."""

import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from daq.counted import counted
from daq.files.run_directory import RunReader
from daq.run.acquisition import Acquisition
from daq.run.events import RunEvent, ShotRecorded
from daq.run.state import RunOutcome
from daq.run_plan import PulsePair, RunKind, RunPlan
from processing.benchmarks import targets
from processing.benchmarks.targets import Measured
from server.cli.benchmarks.bench_rig import rig_in
from server.rig.assembly import open_rig
from server.rig.config import RigConfig, load_config

WARM_SHOTS = 2
DEADLINE_S = 300.0
_OF_MEDIAN = 1.4826 / np.sqrt(6)
"""Standard deviation of noise, of the median of its second differences, which smooth light leaves at 0."""


def recorded_shots(directory: Path | None, shots: int) -> Iterator[Measured]:
    """Record a spray, with 8 and with 16 bit; its images are drawn once, before the shots that count."""
    for (bits, rate_hz), target in targets.CAMERAS.items():
        with TemporaryDirectory(dir=directory) as folder:
            config = load_config(rig_in(Path(folder), bits, still=True))
            cpu_s, how = _recorded(config, shots, rate_hz)
        yield Measured(target, cpu_s, how=f"{counted(shots, 'shot')}, {how}")


def _recorded(config: RigConfig, shots: int, rate_hz: float) -> tuple[float | None, str]:
    """CPU time of this process per shot, and the noise of its images; or why the run did not come to its end."""
    used_s: list[float] = []

    def note(event: RunEvent) -> None:
        if isinstance(event, ShotRecorded):
            used_s.append(time.process_time())

    pulse = PulsePair(current_a={name: view.nominal_current_a for name, view in config.views.items()})
    plan = RunPlan(name="bench", kind=RunKind.SAMPLE, shots=WARM_SHOTS + shots, rate_hz=rate_hz, pulse=pulse)
    with open_rig(config) as assembled:
        limits, observers = config.acquisition.to_limits(), assembled.observers
        with Acquisition(
            assembled.rig, config.server.data_dir, note, limits=limits, observers=observers
        ) as acquisition:
            run_id = acquisition.start(plan)
            status = acquisition.wait(DEADLINE_S)
    if status.outcome is not RunOutcome.COMPLETED:
        return None, f"the run ended {status.outcome}: {status.message}"
    return (used_s[-1] - used_s[WARM_SHOTS - 1]) / shots, _noise(config.server.data_dir / run_id)


def _noise(run_dir: Path) -> str:
    with RunReader(run_dir) as run:
        view, frames = next(iter(run.read_shot(0).views.items()))
        most = 2 ** run.header.views[view].bits - 1
    noise = float(np.median(np.abs(np.diff(frames.frame_a.astype(np.float64), n=2)))) * float(_OF_MEDIAN)
    return f"noise {noise:.2g} of {most}"
