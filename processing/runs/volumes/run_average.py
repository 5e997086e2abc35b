"""The mean volume of recorded shots, straight from their images: no volume of a single exposure is kept."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from daq.files.run_directory import RunReader
from processing.calibration.calibration import Calibration
from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity
from processing.reconstruction.mean_line_of_sight import MeanVolume, mean_volume
from processing.reconstruction.planning.calibrated_plan import plan_of
from processing.reconstruction.reconstructor import Reconstructor
from processing.reconstruction.settings import ReconstructionSettings
from processing.runs.exposure_faults import copied, exposure_faults
from processing.runs.results_file import ExposureKey, FrameName
from processing.runs.seen_views import seen_views
from processing.runs.shots.meeting_lines import MeetingLines
from processing.runs.shots.meetings import Meeting, seldom_meeting, with_odd
from processing.runs.shots.shot_images import require_match, shot_intensities
from processing.runs.shots.shot_light import Shares, light_shares
from processing.runs.workbench import References, Workbench
from processing.volume import VoxelGrid

Exposures = Iterator[list[Intensity]]


@dataclass(frozen=True, eq=False)
class RunAverage:
    """Mean of the volumes of many exposures.

    Parameters
    ----------
    mean : MeanVolume
        Its slabs and parts, made as often as somebody asks for them.
    grid : VoxelGrid
        Where it lies.
    exposures : int
        How many.
    faults : tuple
        Shots whose images may be wrong, and how: ``shot``, and what ``exposure_faults`` has found.
    seldom : list of int
        Shots in which lines of sight meet much more seldom than in the others, see ``seldom_meeting``.
    light : mapping
        Share of its background's light, by exposure and view.
    """

    mean: MeanVolume
    grid: VoxelGrid
    exposures: int
    faults: tuple[Mapping[str, Any], ...]
    seldom: list[int]
    light: Mapping[ExposureKey, Shares]


def average_run(
    run_dir: Path,
    shots: Sequence[int],
    calibration: Calibration,
    settings: ReconstructionSettings,
    done: Callable[[int, int], None] = lambda _done, _of: None,
    *,
    frame: FrameName = "a",
    threads: int = DEFAULT_THREADS,
    workbench: Workbench | None = None,
) -> RunAverage:
    """Mean of what ``reconstruct_shot`` makes of one exposure of some shots.

    Parameters
    ----------
    run_dir : Path
        The recorded run.
    shots : sequence of int
        At least one.
    calibration : Calibration
        Of the views of the run.
    settings : ReconstructionSettings
        Method, grid and preprocessing.
    done : callable
        Told how many exposures of how many have been read, after each.
    frame : {"a", "b"}
        Which exposure: A and B are different times.
    threads : int
        The mean does not depend on it.
    workbench : Workbench, optional
        Keeps the references of the run for what comes next.

    Raises
    ------
    PipelineError
        A shot is not valid, or run and calibration do not belong together.
    CalibrationError
        The calibration was refused.
    """
    with (workbench or Workbench()).occupied() as bench, RunReader(run_dir) as run:
        calibration.require_usable(run.header.views)
        plan = plan_of(calibration, settings, tuple(run.header.views))
        faults: list[Mapping[str, Any]] = []
        lines, meetings = MeetingLines.of(calibration, tuple(run.header.views)), dict[ExposureKey, Meeting]()
        references = bench.references(run)
        light = dict[ExposureKey, Shares]()
        exposures = _exposures(run, shots, frame, calibration, settings, references, done, threads, faults, light)
        if lines:
            exposures = _looked_at(exposures, shots, frame, lines, meetings)
        if settings.method.iterative:
            mean = MeanVolume.of(_mean_of_each(Reconstructor.of(plan, settings, threads), exposures))
        else:
            mean = mean_volume(plan, exposures, settings.method, threads=threads)
        told, seldom = tuple(with_odd(faults, meetings)), seldom_meeting(meetings)
        return RunAverage(mean, plan.grid, len(shots), told, seldom, light)


def _looked_at(
    exposures: Exposures,
    shots: Sequence[int],
    frame: FrameName,
    lines: MeetingLines,
    meetings: dict[ExposureKey, Meeting],
) -> Exposures:
    """The same exposures, each asked whether lines of sight meet in it."""
    for index, images in zip(shots, exposures, strict=True):
        meetings[index, frame] = lines.meeting(images)
        yield images


def _exposures(
    run: RunReader,
    shots: Sequence[int],
    frame: FrameName,
    calibration: Calibration,
    settings: ReconstructionSettings,
    references: References,
    done: Callable[[int, int], None],
    threads: int,
    faults: list[Mapping[str, Any]],
    light: dict[ExposureKey, Shares],
) -> Exposures:
    """Images of exposure after exposure; ``faults`` gets those that may be wrong, ``light`` the shares of all."""
    before: dict[bytes, int] = {}
    for count, index in enumerate(shots, start=1):
        shot = run.read_shot(index, "a" if frame == "a" else "ab")
        require_match(run.header.run_id, shot, calibration)
        images = shot_intensities(run, shot, frame, settings, references=references, threads=threads)
        seen, polarity = seen_views(run, shot, frame, references), run.header.polarity
        found: dict[str, Any] = {**exposure_faults(seen, polarity, images), **copied(shot, frame, images, before)}
        if told := {name: what for name, what in found.items() if what or name == "copy_of"}:
            faults.append({"shot": index, **told})
        light[index, frame] = light_shares(seen, polarity)
        yield images
        done(count, len(shots))


def _mean_of_each(reconstructor: Reconstructor, exposures: Exposures) -> Intensity:
    mean, count = np.zeros(reconstructor.plan.grid.shape, np.float32), 0
    for images in exposures:
        volume, _ = reconstructor.reconstruct(images)
        for first_row, slab in volume.intensities():
            mean[:, first_row : first_row + slab.shape[1]] += slab
        count += 1
    mean /= np.float32(count)
    return mean
