"""One shot + one calibration + settings -> volumes on disk. Every shot by itself, whoever asks for it."""

import json
import resource
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path

import numpy as np

from daq.run_file import RUN_FILE
from daq.shotfile import RunReader, Shot
from processing.calibration.calibration import Calibration, Verdict
from processing.calibration.calibration_file import file_sha256, load_calibration
from processing.calibration.errors import CalibrationError
from processing.preprocessing import Intensity, Preprocessing, intensity
from processing.reconstruction.common_volume import common_volume
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.method import ReconstructionMethod
from processing.reconstruction.plan import Plan, plan_reconstruction
from processing.reconstruction.planned_view import PlannedView
from processing.reconstruction.settings import FrozenValue, GridSettings, ReconstructionSettings
from processing.reconstruction.smart import mart, smart
from processing.reconstruction.volume_file import write_volume
from processing.results_file import FrameName, Provenance, claim_results, volume_path
from processing.volume import VoxelGrid

_References = dict[str, tuple[Intensity | None, Intensity | None]]


class PipelineError(Exception):
    """A shot cannot be reconstructed; the text names run, shot and reason."""


class Stopped(Exception):
    """The reconstruction was told to stop."""


class VolumeRecord(FrozenValue):
    """One volume that was written; ``seconds`` is the wall time of its reconstruction.

    ``residuals`` are those of SMART and MART, see ``processing.reconstruction.smart.SmartResult``.
    """

    shot: int
    frame: FrameName
    file: str
    seconds: float
    residuals: tuple[float, ...] = ()


class ShotResult(FrozenValue):
    """What became of one shot; ``views`` tells how each view was seen."""

    shot: int
    method: ReconstructionMethod
    grid: GridSettings
    views: Mapping[str, PlannedView]
    volumes: tuple[VolumeRecord, ...]
    cpu_s: float
    peak_rss_mb: float


def reconstruct_shot(
    run_dir: Path,
    shot: int,
    calibration_file: Path,
    settings: ReconstructionSettings,
    results_dir: Path,
    should_stop: Callable[[], bool] = lambda: False,
) -> ShotResult:
    """Reconstruct every exposure of one shot and write its volumes.

    Parameters
    ----------
    run_dir : Path
        The recorded run.
    shot : int
        Index of the shot.
    calibration_file : Path
        Calibration of the views of the run.
    settings : ReconstructionSettings
        Method, grid and preprocessing.
    results_dir : Path
        Receives the volumes; a volume of the same shot and settings is replaced atomically.
    should_stop : callable
        Asked between the steps.

    Raises
    ------
    PipelineError
        The shot is not valid, or run and calibration do not belong together.
    CalibrationError
        The calibration was refused.
    Stopped
        ``should_stop`` said so.
    """
    started_cpu_s = time.process_time()
    calibration = load_calibration(calibration_file)
    with RunReader(run_dir) as run:
        recorded = run.read_shot(shot)
        require_match(run_dir.name, recorded, calibration)
        made_by = _provenance(run, calibration, calibration_file, settings)
        bench = _workbench(calibration_file, str(made_by["calibration_sha256"]), settings, tuple(recorded.views))
        views = {name: PlannedView.of(view) for name, view in zip(recorded.views, bench.plan.views, strict=True)}
        provenance = {**made_by, "views": json.dumps({name: view.model_dump() for name, view in views.items()})}
        claim_results(results_dir, provenance)
        volumes = []
        for frame in frame_names(run):
            if should_stop():
                raise Stopped(f"{run_dir.name}, shot {shot}: stopped before exposure {frame}")
            images = shot_intensities(run, recorded, frame, settings, bench.images)
            volumes.append(_reconstruct_frame(bench, images, settings, results_dir, shot, frame, provenance))
    return ShotResult(
        shot=shot,
        method=settings.method,
        grid=GridSettings.of(bench.plan.grid),
        views=views,
        volumes=tuple(volumes),
        cpu_s=time.process_time() - started_cpu_s,
        peak_rss_mb=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    )


def reconstruct(
    plan: Plan, images: Sequence[Intensity], settings: ReconstructionSettings, out: Intensity
) -> tuple[float, ...]:
    """Reconstruct one exposure by the method of the settings; ``out`` (z, y, x) receives it. Returns the residuals."""
    if not settings.method.iterative:
        line_of_sight(plan, images, settings.method, out)
        return ()
    solve = smart if settings.method is ReconstructionMethod.SMART else mart
    result = solve(
        plan,
        images,
        iterations=settings.iterations,
        relaxation=settings.relaxation,
        least_gain=settings.least_gain,
        out=out,
    )
    return result.residuals


def default_grid(calibration: Calibration, pitch_mm: float | None = None) -> VoxelGrid:
    """The volume that all views see within the calibrated z range; x and y reach a quarter beyond the target."""
    return common_volume(
        [view.mapping for view in calibration.views.values()],
        x_range_mm=_widened(calibration.x_range_mm),
        y_range_mm=_widened(calibration.y_range_mm),
        z_range_mm=calibration.z_range_mm,
        pitch_mm=pitch_mm,
    )


def shot_intensities(
    run: RunReader,
    shot: Shot,
    frame: FrameName,
    settings: ReconstructionSettings,
    out: Sequence[Intensity | None] | None = None,
) -> list[Intensity]:
    """Preprocessed images of one exposure, in the order of the shot's views; ``out`` receives them where given."""
    header, references, number = run.header, _references(run), "ab".index(frame)
    preprocessing = Preprocessing(header.polarity, settings.minimum_window_px, settings.noise_floor)
    images = []
    for (view, exposures), image in zip(shot.views.items(), out or [None] * len(shot.views), strict=True):
        pixels = (exposures.frame_a, exposures.frame_b)[number]
        if pixels is None:
            raise PipelineError(f"{header.run_id}, shot {shot.index}: {view} has no exposure {frame}")
        dark, background = references[view]
        images.append(
            intensity(
                pixels,
                preprocessing,
                bits=header.views[view].bits,
                dark=None if dark is None else dark[number],
                background=None if background is None else background[number],
                out=image,
            )
        )
    return images


def _references(run: RunReader) -> _References:
    return _read_references(run.run_dir, (run.run_dir / RUN_FILE).stat().st_mtime_ns)


@lru_cache(maxsize=1)
def _read_references(run_dir: Path, _written_ns: int) -> _References:
    """Dark and background of every view; to unpack them takes longer than to reconstruct a shot."""
    with RunReader(run_dir) as run:
        return {view: (run.dark(view), run.background(view)) for view in run.header.views}


@dataclass(frozen=True, eq=False)
class _Workbench:
    """What the shots of a run share: first touch of fresh memory costs more than a reconstruction."""

    plan: Plan
    images: tuple[Intensity, ...]
    volume: Intensity


def _reconstruct_frame(
    bench: _Workbench,
    images: list[Intensity],
    settings: ReconstructionSettings,
    results_dir: Path,
    shot: int,
    frame: FrameName,
    provenance: Provenance,
) -> VolumeRecord:
    started_s = time.perf_counter()
    residuals = reconstruct(bench.plan, images, settings, bench.volume)
    seconds = round(time.perf_counter() - started_s, 4)
    file = volume_path(results_dir, shot, frame)
    convergence = {"residuals": json.dumps(residuals)} if residuals else {}
    write_volume(file, bench.volume, bench.plan.grid, {**provenance, "shot": shot, "frame": frame, **convergence})
    return VolumeRecord(shot=shot, frame=frame, file=file.name, seconds=seconds, residuals=residuals)


def frame_names(run: RunReader) -> tuple[FrameName, ...]:
    """Exposures of every shot of a run."""
    return ("a", "b") if run.header.frames_per_shot == 2 else ("a",)


def require_match(run_name: str, shot: Shot, calibration: Calibration) -> None:
    """Refuse a shot that is not whole, and a calibration that is not made for it or not good enough."""
    if not shot.valid:
        raise PipelineError(f"{run_name}, shot {shot.index}: exposures are missing, nothing to reconstruct")
    calibration.require_world()
    unknown = sorted(set(shot.views) - set(calibration.views))
    if unknown:
        raise PipelineError(
            f"{run_name}: views {unknown} are not in the calibration, it has {sorted(calibration.views)}"
        )
    for name, exposures in shot.views.items():
        rows, columns = exposures.frame_a.shape
        view = calibration.views[name]
        if (columns, rows) != view.mapping.image_size_px:
            raise PipelineError(
                f"{run_name}, {name}: image of {columns} x {rows} px, calibrated for {view.mapping.image_size_px}"
            )
        if view.verdict is Verdict.REFUSE:
            raise CalibrationError(
                f"calibration {calibration.id}, {name}: hold-out error {view.holdout_error_px:.3g} px is refused"
            )


def _provenance(
    run: RunReader, calibration: Calibration, calibration_file: Path, settings: ReconstructionSettings
) -> Provenance:
    return {
        "run": run.header.run_id,
        "calibration": calibration.id,
        "calibration_file": calibration_file.name,
        "calibration_sha256": file_sha256(calibration_file),
        "settings": settings.model_dump_json(),
        "tomoshadow": version("tomoshadow"),
    }


@lru_cache(maxsize=1)
def _workbench(
    calibration_file: Path, _sha256: str, settings: ReconstructionSettings, views: tuple[str, ...]
) -> _Workbench:
    calibration = load_calibration(calibration_file)
    grid = settings.grid.to_grid() if settings.grid else default_grid(calibration)
    plan = plan_reconstruction([calibration.views[view].mapping for view in views], grid, settings.accuracy)
    images = tuple(np.empty(view.image_size_px[::-1], np.float32) for view in plan.views)
    return _Workbench(plan, images, np.empty(grid.shape, np.float32))


def _widened(span_mm: tuple[float, float]) -> tuple[float, float]:
    quarter_mm = (span_mm[1] - span_mm[0]) / 4
    return span_mm[0] - quarter_mm, span_mm[1] + quarter_mm
