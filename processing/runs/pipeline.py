"""Shots + a calibration + settings -> volumes on disk. Every shot by itself, whoever asks for it."""

import json
import resource
import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from threading import Lock
from typing import TypedDict, Unpack

from daq.files.run_directory import RunReader
from processing.calibration.calibration import Calibration
from processing.calibration.calibration_file import file_sha256, load_calibration
from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity
from processing.reconstruction.planning.common_volume import common_volume
from processing.reconstruction.planning.plan import Plan, plan_reconstruction
from processing.reconstruction.planning.planned_view import PlannedView
from processing.reconstruction.reconstructor import Reconstructor
from processing.reconstruction.settings import METHOD_VERSION, FrozenValue, GridSettings, ReconstructionSettings
from processing.reconstruction.slab_volume import SlabVolume
from processing.reconstruction.volume_file import write_slabs
from processing.runs.exposure_faults import Faults, exposure_faults
from processing.runs.recipe import recipe_sha256
from processing.runs.results_file import FrameName, Provenance, claim_results, volume_path
from processing.runs.shots.clocked_slabs import ClockedSlabs
from processing.runs.shots.lanes import in_lanes
from processing.runs.shots.read_ahead import read_ahead
from processing.runs.shots.shot_images import frame_names, require_match, shot_intensities
from processing.runs.shots.shot_result import ShotResult, VolumeRecord
from processing.runs.workbench import References, Workbench
from processing.volume import VoxelGrid

_MOST_LANES = 2
"""Shots side by side: where one is read, packed or waits for the disk, another one is computed. Each takes memory."""


class Stopped(Exception):
    """The reconstruction was told to stop."""


Keep = Callable[[Path, SlabVolume, VoxelGrid, Provenance], None]
"""Takes the slabs of a volume as they are made: its file, or what stands for it."""


class Options(TypedDict, total=False):
    """What the values of volumes do not depend on.

    Parameters
    ----------
    workbench : Workbench
        For shot after shot: volumes come earlier.
    threads : int
        That work side by side.
    told : callable
        What else is known of a shot, for its volumes; asked once there is something to write.
    keep : Keep
        What is kept of a volume; all of it by default, as VTKHDF.
    look : callable
        Shown the images of each exposure of a shot.
    """

    workbench: Workbench
    threads: int
    told: Callable[[], Provenance]
    keep: Keep
    look: Callable[[int, Sequence[Intensity]], None]


@dataclass(frozen=True, eq=False)
class _Chain:
    """What all exposures of a run share; of a single lane, the next exposure is read while one is reconstructed."""

    run: RunReader
    calibration: Calibration
    settings: ReconstructionSettings
    lanes: tuple[Reconstructor, ...]
    references: References
    provenance: Provenance
    views: Mapping[str, PlannedView]
    threads: int
    writing: Lock = field(default_factory=Lock)

    @property
    def grid(self) -> VoxelGrid:
        """Of all volumes."""
        return self.lanes[0].plan.grid


@dataclass(frozen=True, eq=False)
class _Exposure:
    """Images of an exposure, ready to be reconstructed, and what is wrong with them."""

    shot: int
    frame: FrameName
    images: list[Intensity]
    faults: Faults


def reconstruct_shot(
    run_dir: Path,
    shot: int,
    calibration_file: Path,
    settings: ReconstructionSettings,
    results_dir: Path,
    should_stop: Callable[[], bool] = lambda: False,
    **options: Unpack[Options],
) -> ShotResult:
    """Reconstruct every exposure of one shot, as ``reconstruct_shots`` does."""
    (result,) = reconstruct_shots(run_dir, [shot], calibration_file, settings, results_dir, should_stop, **options)
    return result


def reconstruct_shots(
    run_dir: Path,
    shots: Sequence[int],
    calibration_file: Path,
    settings: ReconstructionSettings,
    results_dir: Path,
    should_stop: Callable[[], bool] = lambda: False,
    **options: Unpack[Options],
) -> Generator[ShotResult, None, None]:
    """Reconstruct every exposure of some shots; two shots side by side where there are two threads.

    The images of one exposure are made while that before it is reconstructed.

    Parameters
    ----------
    run_dir : Path
        The recorded run.
    shots : sequence of int
        Their indices.
    calibration_file : Path
        Calibration of the views of the run.
    settings : ReconstructionSettings
        Method, grid and preprocessing.
    results_dir : Path
        Receives the volumes; a volume of the same shot and settings is replaced atomically.
    should_stop : callable
        Asked between the steps.
    **options
        See ``Options``.

    Raises
    ------
    PipelineError
        A shot is not valid, or run and calibration do not belong together.
    CalibrationError
        The calibration was refused.
    ReconstructionError
        Its views see too little in common, or are too few.
    Stopped
        ``should_stop`` said so.
    """
    threads, keep = options.get("threads", DEFAULT_THREADS), options.get("keep", write_slabs)
    told, look = options.get("told", dict), options.get("look")
    started_cpu_s = time.process_time()
    with (options.get("workbench") or Workbench()).occupied() as bench, RunReader(run_dir) as run:
        chain = _chain_of(run, calibration_file, settings, bench, threads, len(shots))

        def volumes_of(lane: Reconstructor, shot: int) -> list[VolumeRecord]:
            volumes = []
            exposures = _exposures(chain, lane, shot)
            for exposure in read_ahead(exposures) if len(chain.lanes) == 1 else exposures:
                if look:
                    look(exposure.shot, exposure.images)
                if should_stop():
                    raise Stopped(f"{run_dir.name}, shot {exposure.shot}: stopped before exposure {exposure.frame}")
                with chain.writing:  # whoever is first makes the folder, and has told what is known for all
                    claim_results(results_dir, chain.provenance)
                    known = told()
                volumes.append(_reconstruct(chain, lane, exposure, results_dir, known, keep))
            return volumes

        with closing(in_lanes(shots, chain.lanes, volumes_of)) as coming:
            for volumes in coming:
                yield _result(chain, volumes, time.process_time() - started_cpu_s)
                started_cpu_s = time.process_time()


def _chain_of(
    run: RunReader, calibration_file: Path, settings: ReconstructionSettings, bench: Workbench, threads: int, shots: int
) -> _Chain:
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
    return _Chain(run, calibration, settings, reconstructors, bench.references(run), provenance, views, threads)


def _exposures(chain: _Chain, lane: Reconstructor, index: int) -> Iterator[_Exposure]:
    """Exposure after exposure of a shot, each in memory of its own if it is read ahead."""
    run, settings, references = chain.run, chain.settings, chain.references
    shot = run.read_shot(index)
    require_match(run.run_dir.name, shot, chain.calibration)
    for frame, memory in zip(
        frame_names(run), lane.images if len(chain.lanes) == 1 else 2 * lane.images[:1], strict=False
    ):
        images = shot_intensities(run, shot, frame, settings, memory, references=references, threads=chain.threads)
        yield _Exposure(index, frame, images, exposure_faults(run, shot, frame, images, references))


def _reconstruct(
    chain: _Chain, lane: Reconstructor, exposure: _Exposure, results_dir: Path, told: Provenance, keep: Keep
) -> VolumeRecord:
    """Slabs are kept as they are made; the time of keeping them does not count."""
    started_s = time.perf_counter()
    volume, residuals = lane.reconstruct(exposure.images)
    begun_s = time.perf_counter() - started_s
    slabs = ClockedSlabs(volume.slabs)
    file = volume_path(results_dir, exposure.shot, exposure.frame)
    convergence = {"residuals": json.dumps(residuals)} if residuals else {}
    named = {**_named(chain, exposure), **told, "shot": exposure.shot, "frame": exposure.frame, **convergence}
    keep(file, replace(volume, slabs=slabs), chain.grid, named)
    record = VolumeRecord(
        shot=exposure.shot,
        frame=exposure.frame,
        file=file.name,
        seconds=round(begun_s + slabs.seconds, 4),
        residuals=residuals,
        empty=slabs.empty,
        lost_share=volume.losses.intensity_share if volume.losses else 0.0,
    )
    return record.model_copy(update=exposure.faults)


def _named(chain: _Chain, exposure: _Exposure) -> Provenance:
    """Where a volume comes from, and what is wrong with its images."""
    found = {name: json.dumps(which) for name, which in exposure.faults.items() if which}
    return {**chain.provenance, **found, "recipe_sha256": recipe_sha256("reconstruct", METHOD_VERSION, chain.settings)}


def _result(chain: _Chain, volumes: Sequence[VolumeRecord], cpu_s: float) -> ShotResult:
    return ShotResult(
        shot=volumes[0].shot,
        method=chain.settings.method,
        grid=GridSettings.of(chain.grid),
        views=chain.views,
        volumes=tuple(volumes),
        cpu_s=cpu_s,
        peak_rss_mb=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    )


def default_grid(calibration: Calibration, pitch_mm: float | None = None) -> VoxelGrid:
    """The largest box that all views see within the calibrated z range; x and y reach a quarter beyond the target."""
    return common_volume(
        [view.mapping for view in calibration.views.values()],
        x_range_mm=_widened(calibration.x_range_mm),
        y_range_mm=_widened(calibration.y_range_mm),
        z_range_mm=calibration.z_range_mm,
        pitch_mm=pitch_mm,
    )


def provenance_of(
    run: RunReader, calibration: Calibration, calibration_file: Path, settings: FrozenValue, method_version: int
) -> Provenance:
    """Where results of a run come from."""
    return {
        "run": run.header.run_id,
        "run_created_utc": run.header.created_utc,
        "calibration": calibration.id,
        "calibration_file": calibration_file.name,
        "calibration_sha256": file_sha256(calibration_file),
        "settings": settings.model_dump_json(),
        "method_version": method_version,
        "tomoshadow": version("tomoshadow"),
    }


def _reconstructors(
    calibration: Calibration, settings: ReconstructionSettings, views: Sequence[str], threads: int, count: int
) -> tuple[Reconstructor, ...]:
    plan = plan_of(calibration, settings, views)
    return tuple(Reconstructor.of(plan, settings, threads) for _ in range(count))


def plan_of(calibration: Calibration, settings: ReconstructionSettings, views: Sequence[str]) -> Plan:
    """Where these views see the grid of the settings, or the default one."""
    grid = settings.grid.to_grid() if settings.grid else default_grid(calibration)
    return plan_reconstruction([calibration.views[view].mapping for view in views], grid, settings.accuracy, views)


def _widened(span_mm: tuple[float, float]) -> tuple[float, float]:
    quarter_mm = (span_mm[1] - span_mm[0]) / 4
    return span_mm[0] - quarter_mm, span_mm[1] + quarter_mm
