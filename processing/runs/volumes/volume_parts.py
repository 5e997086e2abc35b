"""VolumeParts: slices and regions of volumes at full resolution, made from the images of a shot when somebody looks.

A volume of the paper's grid has 600 million voxels, and its images make it again in a tenth of a second; a slice takes
a hundredth of that. So volumes are a cache, and a part of one need not be in it.
"""

from collections.abc import Hashable
from dataclasses import dataclass
from pathlib import Path
from threading import Lock

import numpy as np

from daq.files.run_directory import RunReader
from daq.files.run_file import RUN_FILE
from processing.calibration.calibration_file import file_sha256, load_calibration
from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.planning.calibrated_plan import plan_of
from processing.reconstruction.planning.plan import Plan
from processing.reconstruction.seen_exposure import SeenExposure
from processing.reconstruction.settings import METHOD_VERSION, ReconstructionSettings
from processing.reconstruction.volume_file import open_volume
from processing.reconstruction.volume_part import RangesMm, part_within
from processing.runs.errors import PipelineError
from processing.runs.results_file import FrameName, Provenance
from processing.runs.shots.shot_images import require_match, shot_intensities
from processing.runs.workbench import Latest, References, read_references
from processing.volume import VoxelGrid

EXPOSURES_KEPT = 4
"""Resampled images of one take 11 MB on the paper's rig; references of a run 120 MB."""
_PLANES_AT_ONCE = 16


@dataclass(frozen=True, eq=False)
class VolumePart:
    """A part of a volume.

    Parameters
    ----------
    voxels : (nz, ny, nx) float32 array
        Intensities.
    grid : VoxelGrid
        Where they lie.
    method : ReconstructionMethod
        What made them.
    """

    voxels: Intensity
    grid: VoxelGrid
    method: ReconstructionMethod


@dataclass(frozen=True)
class Recipe:
    """What a volume was made of.

    Parameters
    ----------
    run_dir : Path
        The run.
    shot, frame : int, {"a", "b"}
        Which exposure.
    calibration_file : Path
        As it is now.
    settings : ReconstructionSettings
        Method, grid and preprocessing.
    made_by : Provenance
        What the volume says of itself.
    """

    run_dir: Path
    shot: int
    frame: FrameName
    calibration_file: Path
    settings: ReconstructionSettings
    made_by: Provenance


class VolumeParts:
    """Makes parts of volumes; one at a time, whoever asks.

    It keeps what was looked at last: the references of one run, one plan, and ``EXPOSURES_KEPT`` exposures.

    Parameters
    ----------
    threads : int
        Of the kernels; the parts do not depend on it.
    """

    def __init__(self, threads: int = DEFAULT_THREADS) -> None:
        self._threads = threads
        self._lock = Lock()
        self._references: Latest[References] = Latest()
        self._plans: Latest[Plan] = Latest()
        self._exposures: Latest[SeenExposure] = Latest(EXPOSURES_KEPT)

    def seen(self, recipe: Recipe, ranges_mm: RangesMm, method: ReconstructionMethod) -> VolumePart:
        """A part of the volume of a recipe, by any line-of-sight method; bit by bit that of the whole volume.

        Raises
        ------
        PipelineError
            Run or calibration are not those that the volume was made of, or its images are incomplete.
        PartError
            There is no such part, or it is too large.
        ShotFileError
            The shot cannot be read.
        """
        with self._lock:
            exposure = self._exposure(recipe)
            whole = exposure.plan.grid
            part = part_within(whole, ranges_mm)
            return VolumePart(
                exposure.part(part, method, recipe.settings.voxels, self._threads), part.grid(whole), method
            )

    def _exposure(self, recipe: Recipe) -> SeenExposure:
        run_file, settings = recipe.run_dir / RUN_FILE, recipe.settings
        run = (recipe.run_dir, run_file.stat().st_mtime_ns)
        sha256 = file_sha256(recipe.calibration_file)
        plan = (sha256, settings.grid, settings.accuracy)
        images = (settings.minimum_window_px, settings.noise_floor)
        key = (run, recipe.shot, recipe.frame, plan, images)
        return self._exposures.of(key, lambda: self._see(recipe, run, (run, plan), sha256))

    def _see(self, recipe: Recipe, run_key: Hashable, plan_key: Hashable, sha256: str) -> SeenExposure:
        calibration = load_calibration(recipe.calibration_file)
        with RunReader(recipe.run_dir) as run:
            _require_same(recipe, calibration_sha256=sha256, run_created_utc=run.header.created_utc)
            shot = run.read_shot(recipe.shot)
            require_match(recipe.run_dir.name, shot, calibration)
            references = self._references.of(run_key, lambda: read_references(run))
            plan = self._plans.of(plan_key, lambda: plan_of(calibration, recipe.settings, tuple(run.header.views)))
            images = shot_intensities(
                run, shot, recipe.frame, recipe.settings, references=references, threads=self._threads
            )
        return SeenExposure.of(plan, images, self._threads)


def stored_part(volume: Path, ranges_mm: RangesMm, method: ReconstructionMethod) -> VolumePart:
    """A part of a volume that is stored, read plane by plane: nobody else reads HDF5 meanwhile."""
    with open_volume(volume) as stored:
        part = part_within(stored.grid, ranges_mm)
        voxels = np.empty(part.shape, np.float32)
        rows, columns = slice(part.y.start, part.y.stop), slice(part.x.start, part.x.stop)
        for first in part.z[::_PLANES_AT_ONCE]:
            planes = slice(first, min(first + _PLANES_AT_ONCE, part.z.stop))
            read = stored[planes, rows][..., columns]
            voxels[first - part.z.start :][: len(read)] = read
        return VolumePart(voxels, part.grid(stored.grid), method)


def _require_same(recipe: Recipe, **now: str) -> None:
    """Refuse to make a part of another volume than was kept."""
    for name, value in {**now, "method_version": METHOD_VERSION}.items():
        if name in recipe.made_by and recipe.made_by[name] != value:
            raise PipelineError(
                f"{recipe.run_dir.name}, shot {recipe.shot}: was made with {name} {recipe.made_by[name]}, now it is "
                f"{value}; reconstruct the shot anew"
            )
