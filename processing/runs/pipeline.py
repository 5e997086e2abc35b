"""One shot + one calibration + settings -> volumes on disk. Every shot by itself, whoever asks for it."""

import json
import resource
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

from daq.files.run_directory import RunReader, Shot
from processing.calibration.calibration import Calibration
from processing.calibration.calibration_file import file_sha256, load_calibration
from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity, intensity
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.planning.common_volume import common_volume
from processing.reconstruction.planning.plan import plan_reconstruction
from processing.reconstruction.planning.planned_view import PlannedView
from processing.reconstruction.reconstructor import Reconstructor
from processing.reconstruction.settings import METHOD_VERSION, FrozenValue, GridSettings, ReconstructionSettings
from processing.reconstruction.volume_file import write_slabs
from processing.runs.clocked_slabs import ClockedSlabs
from processing.runs.errors import PipelineError
from processing.runs.exposure_faults import exposure_faults, grey_values
from processing.runs.recipe import recipe_sha256
from processing.runs.results_file import FrameName, Provenance, claim_results, volume_path
from processing.runs.workbench import References, Workbench, read_references
from processing.volume import VoxelGrid


class Stopped(Exception):
    """The reconstruction was told to stop."""


class VolumeRecord(FrozenValue):
    """One volume that was written; ``seconds`` is the wall time of its reconstruction.

    ``residuals`` are those of SMART and MART, see ``processing.reconstruction.smart.SmartResult``. ``blind_views``
    see nothing in this exposure, no pixel above the noise floor: a shot may be empty, or a lens be covered.
    ``dim_views`` have no grey value above 1/8 of the full scale: light is missing, or the run states too many bits.
    ``odd_light`` says of a view what does not fit its background or the polarity. ``empty``: no voxel is above 0.
    ``lost_share`` of the sum of all intensities is in voxels that were too faint for bytes.
    """

    shot: int
    frame: FrameName
    file: str
    seconds: float
    residuals: tuple[float, ...] = ()
    blind_views: tuple[str, ...] = ()
    dim_views: tuple[str, ...] = ()
    odd_light: Mapping[str, str] = {}
    empty: bool = False
    lost_share: float = 0.0


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
    *,
    workbench: Workbench | None = None,
    threads: int = DEFAULT_THREADS,
    told: Callable[[], Provenance] = dict,
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
    workbench : Workbench, optional
        For shot after shot: the volumes are the same without it, but come later.
    threads : int
        The volumes do not depend on it.
    told : callable
        What else is known of the shot, for its volumes; asked once there is something to write.

    Raises
    ------
    PipelineError
        The shot is not valid, or run and calibration do not belong together.
    CalibrationError
        The calibration was refused.
    ReconstructionError
        Its views see too little in common, or are too few.
    Stopped
        ``should_stop`` said so.
    """
    started_cpu_s = time.process_time()
    calibration = load_calibration(calibration_file)
    with (workbench or Workbench()).occupied() as bench, RunReader(run_dir) as run:
        recorded = run.read_shot(shot)
        require_match(run_dir.name, recorded, calibration)
        made_by = provenance_of(run, calibration, calibration_file, settings, METHOD_VERSION)
        shown, named_by = tuple(recorded.views), made_by["calibration_sha256"]
        reconstructor = bench.reconstructor(
            (named_by, settings, shown, threads), lambda: _reconstructor(calibration, settings, shown, threads)
        )
        references = bench.references(run)
        planned = zip(recorded.views, reconstructor.plan.views, strict=True)
        views = {name: PlannedView.of(view) for name, view in planned}
        provenance = {**made_by, "views": json.dumps({name: view.model_dump() for name, view in views.items()})}
        claim_results(results_dir, provenance)
        recipe = recipe_sha256("reconstruct", METHOD_VERSION, settings)
        volumes = []
        for frame in frame_names(run):
            if should_stop():
                raise Stopped(f"{run_dir.name}, shot {shot}: stopped before exposure {frame}")
            images = shot_intensities(
                run, recorded, frame, settings, reconstructor.images, references=references, threads=threads
            )
            faults = exposure_faults(run, recorded, frame, images, references)
            found = {name: json.dumps(which) for name, which in faults.items() if which} | {"recipe_sha256": recipe}
            named = {**provenance, **found, **told()}
            written = _reconstruct_frame(reconstructor, images, results_dir, shot, frame, named)
            volumes.append(written.model_copy(update=faults))
    return ShotResult(
        shot=shot,
        method=settings.method,
        grid=GridSettings.of(reconstructor.plan.grid),
        views=views,
        volumes=tuple(volumes),
        cpu_s=time.process_time() - started_cpu_s,
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


def shot_intensities(
    run: RunReader,
    shot: Shot,
    frame: FrameName,
    settings: ReconstructionSettings,
    out: Sequence[Intensity | None] | None = None,
    *,
    references: References | None = None,
    threads: int = DEFAULT_THREADS,
) -> list[Intensity]:
    """Preprocessed images of one exposure.

    Parameters
    ----------
    run : RunReader
        Has polarity and reference images.
    shot : Shot
        A shot of that run.
    frame : {"a", "b"}
        Which exposure.
    settings : ReconstructionSettings
        Sliding minimum and noise floor.
    out : sequence of (rows, columns) float32 arrays, optional
        Receive the images.
    references : mapping, optional
        Those of the run, where somebody has read them already.
    threads : int
        The images do not depend on it.

    Returns
    -------
    list of (rows, columns) float32 arrays
        In the order of the shot's views: 0 where the view is free, 1 where it is blocked.

    Raises
    ------
    PipelineError
        A view has no such exposure.
    """
    header, number = run.header, "ab".index(frame)
    references = read_references(run) if references is None else references
    preprocessing = settings.preprocessing(header.polarity)
    images = []
    for view, image in zip(shot.views, out or [None] * len(shot.views), strict=True):
        dark, background = references[view]
        images.append(
            intensity(
                grey_values(shot, view, frame),
                preprocessing,
                bits=header.views[view].bits,
                dark=None if dark is None else dark[number],
                background=None if background is None else background[number],
                out=image,
                threads=threads,
            )
        )
    return images


def _reconstruct_frame(
    reconstructor: Reconstructor,
    images: list[Intensity],
    results_dir: Path,
    shot: int,
    frame: FrameName,
    provenance: Provenance,
) -> VolumeRecord:
    """Slabs are written as they are made; the time of writing does not count."""
    started_s = time.perf_counter()
    volume, residuals = reconstructor.reconstruct(images)
    begun_s = time.perf_counter() - started_s
    slabs = ClockedSlabs(volume.slabs)
    file = volume_path(results_dir, shot, frame)
    convergence = {"residuals": json.dumps(residuals)} if residuals else {}
    named = {**provenance, "shot": shot, "frame": frame, **convergence}
    write_slabs(file, replace(volume, slabs=slabs), reconstructor.plan.grid, named)
    seconds = round(begun_s + slabs.seconds, 4)
    return VolumeRecord(
        shot=shot,
        frame=frame,
        file=file.name,
        seconds=seconds,
        residuals=residuals,
        empty=slabs.empty,
        lost_share=volume.losses.intensity_share if volume.losses else 0.0,
    )


def frame_names(run: RunReader) -> tuple[FrameName, ...]:
    """Exposures of every shot of a run."""
    return ("a", "b") if run.header.frames_per_shot == 2 else ("a",)


def require_match(run_name: str, shot: Shot, calibration: Calibration) -> None:
    """Refuse a shot that is not whole, and a calibration that is not made for it or not good enough."""
    if not shot.valid:
        raise PipelineError(f"{run_name}, shot {shot.index}: exposures are missing, nothing to reconstruct")
    calibration.require_usable(shot.views)
    for name, exposures in shot.views.items():
        (rows, columns), size_px = exposures.frame_a.shape, calibration.views[name].mapping.image_size_px
        if (columns, rows) != size_px:
            raise PipelineError(f"{run_name}, {name}: image of {columns} x {rows} px, calibrated for {size_px}")


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


def _reconstructor(
    calibration: Calibration, settings: ReconstructionSettings, views: Sequence[str], threads: int
) -> Reconstructor:
    grid = settings.grid.to_grid() if settings.grid else default_grid(calibration)
    plan = plan_reconstruction([calibration.views[view].mapping for view in views], grid, settings.accuracy, views)
    return Reconstructor.of(plan, settings, threads)


def _widened(span_mm: tuple[float, float]) -> tuple[float, float]:
    quarter_mm = (span_mm[1] - span_mm[0]) / 4
    return span_mm[0] - quarter_mm, span_mm[1] + quarter_mm
