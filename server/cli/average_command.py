"""``tomoshadow average``: the mean of stored volumes, or of a run whose volumes need not be stored."""

from argparse import Namespace
from typing import Any

from processing.calibration.calibration_file import load_calibration
from processing.figures.volume_figures import slices_figure
from processing.reconstruction.settings import GridSettings
from processing.reconstruction.volume_file import VolumeFileError, write_volume
from processing.runs.pipeline import PipelineError, default_grid
from processing.runs.results_file import Provenance, average_volumes, volume_files
from processing.runs.run_average import average_run
from processing.volume import VoxelGrid
from server.cli.commands import (
    parse_grid,
    picture_beside,
    progress,
    reconstruction_settings,
    selected_shots,
    usable_processors,
)


def average(options: Namespace) -> dict[str, Any]:
    """``tomoshadow average``."""
    picture_beside(options.out)
    if options.calibration is None and (options.results / "run.h5").is_file():
        raise PipelineError(f"{options.results} is a run: name its --calibration to average it")
    return _average_results(options) if options.calibration is None else _average_run(options)


def _average_results(options: Namespace) -> dict[str, Any]:
    files = volume_files(options.results)
    if not files:
        raise VolumeFileError(f"{options.results}: there are no volumes to average")
    volume, grid = average_volumes(files)
    return _written(options, volume, grid, len(files), {})


def _average_run(options: Namespace) -> dict[str, Any]:
    calibration = load_calibration(options.calibration)
    grid = parse_grid(options.grid, calibration) if options.grid else default_grid(calibration)
    settings = reconstruction_settings(options, GridSettings.of(grid))
    shots = selected_shots(options.results, options.shots)
    name = options.results.name
    mean = average_run(
        options.results,
        shots,
        calibration,
        settings,
        lambda done: progress(f"{name}: {done} exposures"),
        threads=usable_processors(),
    )
    made_by = {"calibration": calibration.id, "settings": settings.model_dump_json()}
    return {**_written(options, mean.volume, grid, mean.exposures, made_by), "method": options.method}


def _written(options: Namespace, volume: Any, grid: VoxelGrid, count: int, made_by: Provenance) -> dict[str, Any]:
    write_volume(options.out, volume, grid, {"average_of": str(options.results), "volumes": count, **made_by})
    figure = picture_beside(options.out)
    slices_figure(volume, grid, f"mean of {count} volumes").savefig(figure, dpi=120)
    return {
        "file": str(options.out),
        "figure": str(figure),
        "volumes": count,
        "grid": GridSettings.of(grid).model_dump(),
    }
