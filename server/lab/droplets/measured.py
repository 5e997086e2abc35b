"""What the files of droplets of a run say: shot by shot, and of the spray as a whole."""

from functools import lru_cache
from pathlib import Path
from typing import Annotated

from pydantic import Field

from daq.files.later_notes import NOTES_FILE
from daq.files.run_file import RUN_FILE
from daq.frozen_model import FrozenModel
from processing.analysis.droplets.droplet_file import DropletFileError, StoredDroplets
from processing.analysis.droplets.droplet_statistics import DropletStatistics, droplet_statistics, hidden_share
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.analysis.velocity.velocity_statistics import VelocityStatistics, velocity_statistics
from processing.runs.droplets.measured_shot import droplets_path
from processing.runs.droplets.told_together import ToldTogether, told_together
from processing.runs.droplets_in_place import read_in_place
from server.lab.errors import Damaged, NotFound
from server.lab.results import droplet_summaries


class ShotOfDroplets(FrozenModel):
    """A shot that was measured; of two exposures, the less favourable verdict and ratio."""

    shot: Annotated[int, Field(description="position in the run, from 0")]
    droplets: Annotated[int, Field(description="in all exposures")]
    verdict: Annotated[ShotVerdict, Field(description="what they are good for")]
    reasons: Annotated[tuple[str, ...], Field(description="why it is no better, and what to do")]
    residual_over_noise: Annotated[float | None, Field(description="1 is noise; null where nothing was fitted")]
    hidden_share: Annotated[
        float, Field(description="of the volume: in, before or behind liquid that is no droplet, not measured")
    ]


class MeasuredRun(FrozenModel):
    """Droplets that were measured with the same settings and calibration."""

    shots: Annotated[tuple[ShotOfDroplets, ...], Field(description="those that are there")]
    statistics: Annotated[DropletStatistics, Field(description="of all of them; refused exposures do not count")]
    velocity: Annotated[VelocityStatistics, Field(description="of all of them; refused velocities do not count")]
    together: Annotated[ToldTogether, Field(description="what all of them say together, and what nothing checks")]

    @property
    def doubts(self) -> tuple[str, ...]:
        """What is said beside the verdicts of single shots."""
        return (*self.together.doubts, *self.velocity.doubts)


def measured_run(results_dir: Path) -> MeasuredRun:
    """Read the droplets of a result set, in the folder of its run; they are told though nobody can read the run.

    Raises
    ------
    NotFound
        It has none.
    Damaged
        A file cannot be read; the text names it.
    """
    paths = [droplets_path(results_dir, summary.shot) for summary in droplet_summaries(results_dir)]
    if not paths:
        raise NotFound(f"{results_dir.parents[1].name} has no droplets in {results_dir.name}")
    try:
        files = tuple((path, path.stat().st_mtime_ns) for path in paths)
        return _read(files, run_changed_ns(results_dir))
    except (DropletFileError, OSError) as error:
        raise Damaged(str(error)) from error


def droplets_file(results_dir: Path, shot: int) -> Path:
    """File of the droplets of a shot; NotFound if there is none."""
    path = droplets_path(results_dir, shot)
    if not path.is_file():
        raise NotFound(f"{results_dir.parents[1].name} has no droplets of shot {shot} in {results_dir.name}")
    return path


def droplets_of(results_dir: Path, shot: int) -> StoredDroplets:
    """The droplets of a shot; NotFound if there are none, Damaged if they cannot be read."""
    path = droplets_file(results_dir, shot)
    try:
        return _droplets(path, path.stat().st_mtime_ns, run_changed_ns(results_dir))
    except (DropletFileError, OSError) as error:
        raise Damaged(str(error)) from error


def run_changed_ns(results_dir: Path) -> tuple[int, ...]:
    """When header and later notes of the run around came to their places: what was read before is not what holds."""
    files = (results_dir.parents[1] / name for name in (RUN_FILE, NOTES_FILE))
    return tuple(file.stat().st_ctime_ns if file.is_file() else 0 for file in files)


@lru_cache(maxsize=8)
def _droplets(path: Path, _changed_ns: int, _run_changed_ns: tuple[int, ...]) -> StoredDroplets:
    return read_in_place(path)


@lru_cache(maxsize=16)
def _read(files: tuple[tuple[Path, int], ...], _run_changed_ns: tuple[int, ...]) -> MeasuredRun:
    """Once per change of the files, of the run around, or of its conditions."""
    paths = [path for path, _ in files]
    stored = [read_in_place(path) for path in paths]
    return MeasuredRun(
        shots=tuple(map(_told, stored)),
        statistics=droplet_statistics(stored),
        velocity=velocity_statistics(stored),
        together=told_together(stored, paths),
    )


def _told(stored: StoredDroplets) -> ShotOfDroplets:
    exposures = stored.exposures.values()
    ratios = [ratio for exposure in exposures if (ratio := exposure["residual_over_noise"]) is not None]
    verdicts = [ShotVerdict(exposure["verdict"]) for exposure in exposures]
    return ShotOfDroplets(
        shot=int(stored.provenance["shot"]),
        droplets=len(stored.columns["frame"]),
        verdict=max(verdicts, key=list(ShotVerdict).index),
        reasons=tuple(dict.fromkeys(reason for exposure in exposures for reason in exposure["reasons"])),
        residual_over_noise=max(ratios, default=None),
        hidden_share=max(map(hidden_share, exposures), default=0.0),
    )
