"""What a run says of its spray so far, from those of its shots that are measured; while it is recorded, too."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from daq.files.run_directory import ShotFileError
from daq.frozen_model import FrozenModel
from daq.run_plan import ImageKey
from processing.analysis.droplets.droplet_file import DropletFileError
from processing.analysis.spray.spray_statistics import AskedFor, SprayStatistics
from processing.runs.droplets.measured_shot import droplets_path
from processing.runs.liquid.objects import LiquidSummary, liquid_summary
from processing.runs.sprays.conditions import ConditionsChanged
from processing.runs.sprays.measured_spray import read_files, told_spray
from server.lab.droplets.measured import run_changed_ns
from server.lab.errors import Damaged, NotFound
from server.lab.results import droplet_summaries, result_sets
from server.lab.runs.run_store import RunStore

MOST_SHOTS = 50
"""Of so many at most, spread evenly over what is measured: an answer takes seconds, not minutes."""


class SpraySoFar(FrozenModel):
    """Statistics of the spray, and of which shots."""

    results: Annotated[str, Field(description="result set of the droplets")]
    shots: Annotated[tuple[int, ...], Field(description="the sample: shots that were taken, of those measured")]
    measured: Annotated[int, Field(description="shots whose droplets are there")]
    recorded: Annotated[int, Field(description="valid sample shots of the run, so far")]
    statistics: Annotated[SprayStatistics, Field(description="of the sample; refused exposures do not count")]
    liquid: Annotated[LiquidSummary, Field(description="ligaments, sheets and break-up of the same shots")]
    conditions_changed: ConditionsChanged = ()


@dataclass(frozen=True)
class MeasuredSample:
    """Shots of a result set that are measured: an even sample of them.

    Parameters
    ----------
    results : str
        The result set.
    shots : tuple of int
        The sample.
    files : tuple of Path
        Its droplets.
    measured : int
        Shots of the result set that are measured.
    """

    results: str
    shots: tuple[int, ...]
    files: tuple[Path, ...]
    measured: int


def spray_so_far(
    runs: RunStore, run_id: str, results: str | None = None, liquid_kg_m3: float | None = None
) -> SpraySoFar:
    """Statistics of what is measured of a run.

    Parameters
    ----------
    runs : RunStore
        All runs.
    run_id : str
        Which one.
    results : str | None
        Which result set; the newest with droplets where it is not said.
    liquid_kg_m3 : float | None
        Density of the liquid.

    Raises
    ------
    NotFound
        There is no such run, or nothing of it is measured.
    Damaged
        A file of droplets cannot be read.
    """
    run_dir, sample = runs.directory(run_id), measured_sample(runs, run_id, results)
    try:
        later = run_changed_ns(run_dir / "results" / sample.results)
        files = tuple((file, file.stat().st_mtime_ns) for file in sample.files)
        statistics, liquid, changes = _of(files, liquid_kg_m3, later)
    except (DropletFileError, ShotFileError, OSError) as error:
        raise Damaged(str(error)) from error
    recorded = int(np.count_nonzero(runs.image_keys(run_id) == ImageKey.SAMPLE))
    return SpraySoFar(
        results=sample.results,
        shots=sample.shots,
        measured=sample.measured,
        recorded=recorded,
        statistics=statistics,
        liquid=liquid,
        conditions_changed=changes,
    )


def measured_sample(runs: RunStore, run_id: str, results: str | None) -> MeasuredSample:
    """Files of droplets of at most 50 shots of a result set; of the newest with droplets where it is not said.

    Raises
    ------
    NotFound
        There is no such run, or nothing of it is measured.
    """
    run_dir = runs.directory(run_id)
    name = results or next((one.id for one in result_sets(run_dir) if one.droplets), None)
    measured = [one.shot for one in droplet_summaries(run_dir / "results" / name)] if name else []
    if name is None or not measured:
        raise NotFound(f"{run_id}: no droplets are measured{f' in {name}' if name else ''}: measure some of its shots")
    places = np.unique(np.linspace(0, len(measured) - 1, MOST_SHOTS).round().astype(int))
    shots = tuple(measured[place] for place in places)
    files = tuple(droplets_path(run_dir / "results" / name, shot) for shot in shots)
    return MeasuredSample(name, shots, files, len(measured))


@lru_cache(maxsize=16)
def _of(
    files: tuple[tuple[Path, int], ...], liquid_kg_m3: float | None, _changes: tuple[int, ...]
) -> tuple[SprayStatistics, LiquidSummary, tuple[str, ...]]:
    """Once per change of the files, of the conditions of the run, or of the run itself."""
    spray = read_files([file for file, _ in files])
    statistics = told_spray(spray, AskedFor(spray.axis, liquid_kg_m3=liquid_kg_m3))
    return statistics, liquid_summary(spray.shots), spray.changes
