"""The chain from the exposures of a run to their volumes: what all of them share."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock

from daq.files.run_directory import RunReader
from processing.calibration.calibration import Calibration
from processing.calibration.calibration_file import load_calibration
from processing.preprocessing import Intensity
from processing.reconstruction.planning.calibrated_plan import plan_of
from processing.reconstruction.planning.planned_view import PlannedView
from processing.reconstruction.reconstructor import Reconstructor
from processing.reconstruction.settings import METHOD_VERSION, ReconstructionSettings
from processing.runs.exposure_faults import Faults, exposure_faults
from processing.runs.results_file import FrameName, Provenance, provenance_of
from processing.runs.seen_views import seen_views
from processing.runs.shots.meeting_lines import MeetingLines
from processing.runs.shots.meetings import Meeting
from processing.runs.shots.read_ahead import read_ahead
from processing.runs.shots.shot_images import frame_names, require_match, shot_intensities
from processing.runs.shots.shot_light import Shares, light_shares
from processing.runs.workbench import References, Workbench
from processing.volume import VoxelGrid

_MOST_LANES = 2
"""Shots side by side: where one is read, packed or waits for the disk, another one is computed. Each takes memory."""


@dataclass(frozen=True, eq=False)
class Exposure:
    """Images of an exposure, ready to be reconstructed, what is wrong with them, and what others are compared with.

    ``light`` is the share of its background's light, by view.
    """

    shot: int
    frame: FrameName
    images: list[Intensity]
    faults: Faults
    meeting: Meeting | None
    light: Shares


@dataclass(frozen=True, eq=False)
class Chain:
    """What all exposures of a run share.

    Parameters
    ----------
    run : RunReader
        The recorded run.
    calibration : Calibration
        Of its views.
    settings : ReconstructionSettings
        Method, grid and preprocessing.
    lanes : tuple of Reconstructor
        Each works on one shot at a time.
    references : References
        Of the run.
    provenance : Provenance
        Where the volumes come from, but for shot and frame.
    views : mapping of str to PlannedView
        How each view is seen.
    lines : MeetingLines, optional
        Where lines of sight of all views meet; of few views they tell nothing.
    threads : int
        Of every lane.
    writing : Lock
        Of the results directory.
    """

    run: RunReader
    calibration: Calibration
    settings: ReconstructionSettings
    lanes: tuple[Reconstructor, ...]
    references: References
    provenance: Provenance
    views: Mapping[str, PlannedView]
    lines: MeetingLines | None
    threads: int
    writing: Lock = field(default_factory=Lock)

    @classmethod
    def of(
        cls,
        run: RunReader,
        calibration_file: Path,
        settings: ReconstructionSettings,
        bench: Workbench,
        *,
        threads: int,
        shots: int,
    ) -> "Chain":
        """Plan it, or find it on the workbench; for so many shots, with so many threads in all.

        Raises
        ------
        CalibrationError
            The calibration was refused.
        ReconstructionError
            Its views see too little in common, or are too few.
        """
        lanes = 1 if settings.method.iterative else min(_MOST_LANES, threads, shots)
        threads //= lanes
        calibration, shown = load_calibration(calibration_file), tuple(run.header.views)
        calibration.require_usable(shown)
        made_by = provenance_of(run, calibration, calibration_file, settings, METHOD_VERSION)
        reconstructors = bench.reconstructors(
            (made_by["calibration_sha256"], settings, shown, threads, lanes),
            lambda: _reconstructors(calibration, settings, shown, threads, lanes),
        )
        views = {name: PlannedView.of(view) for name, view in zip(shown, reconstructors[0].plan.views, strict=True)}
        provenance = {**made_by, "views": json.dumps({name: view.model_dump() for name, view in views.items()})}
        lines, references = MeetingLines.of(calibration, shown), bench.references(run)
        return cls(run, calibration, settings, reconstructors, references, provenance, views, lines, threads)

    @property
    def grid(self) -> VoxelGrid:
        """Of all volumes."""
        return self.lanes[0].plan.grid

    def exposures(self, lane: Reconstructor, shot: int) -> Iterator[Exposure]:
        """Exposure after exposure of a shot, in memory of the lane.

        No other lane works while a single one reads: there each exposure is read while that before it is used, in
        memory of its own.
        """
        if len(self.lanes) == 1:
            return read_ahead(self._read(shot, lane.images))
        return self._read(shot, 2 * lane.images[:1])

    def _read(self, index: int, memories: Sequence[Sequence[Intensity]]) -> Iterator[Exposure]:
        run, references = self.run, self.references
        shot = run.read_shot(index)
        require_match(run.run_dir.name, shot, self.calibration)
        for frame, memory in zip(frame_names(run), memories, strict=False):
            images = shot_intensities(
                run, shot, frame, self.settings, memory, references=references, threads=self.threads
            )
            meeting = self.lines.meeting(images) if self.lines else None
            seen, polarity = seen_views(run, shot, frame, references), run.header.polarity
            faults, light = exposure_faults(seen, polarity, images), light_shares(seen, polarity)
            yield Exposure(index, frame, images, faults, meeting, light)


def _reconstructors(
    calibration: Calibration, settings: ReconstructionSettings, views: Sequence[str], threads: int, count: int
) -> tuple[Reconstructor, ...]:
    plan = plan_of(calibration, settings, views)
    return tuple(Reconstructor.of(plan, settings, threads) for _ in range(count))
