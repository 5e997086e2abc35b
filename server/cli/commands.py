"""What each command does: parsed arguments in, the JSON object of design out. Progress goes to stderr."""

import json
import os
import re
import resource
import sys
from argparse import ArgumentTypeError, Namespace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from daq.files.run_directory import ImageKey, RunReader
from processing.calibration.calibration import Calibration
from processing.calibration.calibration_file import load_calibration
from processing.reconstruction.accuracy import Accuracy
from processing.reconstruction.method import ReconstructionMethod
from processing.reconstruction.settings import GridSettings, ReconstructionSettings
from processing.reconstruction.voxel_type import VoxelType
from processing.runs.importing import import_manifest
from processing.runs.pipeline import (
    PipelineError,
    ShotResult,
    default_grid,
    reconstruct_shot,
)
from processing.volume import VoxelGrid
from server.rig.config import load_config
from server.rig.optics_table import optics_table

MAX_VOXELS = 10**12
"""More fill any disk: a thousand times the largest volume of the paper's rig."""

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,2})?"


def progress(text: str) -> None:
    """Tell the user what happens, on stderr."""
    print(text, file=sys.stderr, flush=True)  # noqa: T201


def readable(result: dict[str, Any]) -> str:
    """A result for a person."""
    return json.dumps(result, indent=2)


def picture_beside(file: Path) -> Path:
    """Where the picture of a result goes.

    Raises
    ------
    PipelineError
        The result itself is called so; the picture would take its place.
    """
    picture = file.with_suffix(".png")
    if picture == file:
        raise PipelineError(f"{file}: its picture would take its place; choose another ending")
    return picture


def import_images(options: Namespace) -> dict[str, Any]:
    """``tomoshadow import``."""
    return {"out": str(options.out), **import_manifest(options.manifest, options.out)}


def setting(name: str, text: str) -> Any:
    """The value of an option, with the limits of the setting of that name."""
    try:
        return getattr(ReconstructionSettings.model_validate({name: text}), name)
    except ValidationError as error:
        raise ArgumentTypeError(f"{text}: {error.errors()[0]['msg']}") from error


def reconstruction_settings(options: Namespace, grid: GridSettings) -> ReconstructionSettings:
    """Method and options of a command as settings."""
    return ReconstructionSettings(
        method=ReconstructionMethod(options.method),
        accuracy=Accuracy(options.accuracy),
        voxels=VoxelType(options.voxels),
        iterations=options.iterations,
        relaxation=options.relaxation,
        least_gain=options.least_gain,
        grid=grid,
    )


def usable_processors() -> int:
    """Processors that this process may use: as many threads as a command takes, which has the machine to itself."""
    return len(os.sched_getaffinity(0))


def reconstruct_run(options: Namespace) -> dict[str, Any]:
    """``tomoshadow reconstruct``."""
    calibration = load_calibration(options.calibration)
    grid = GridSettings.of(parse_grid(options.grid, calibration) if options.grid else default_grid(calibration))
    settings = reconstruction_settings(options, grid)
    shots = selected_shots(options.run, options.shots)
    results: list[ShotResult] = []
    for shot in shots:
        progress(f"{options.run.name}: shot {shot} by {options.method}")
        result = reconstruct_shot(
            options.run, shot, options.calibration, settings, options.out, threads=usable_processors()
        )
        results.append(result)
        if len(results) == 1:
            _tell_slow_views(results[0])
        _tell_blind_views(results[-1])
    return {
        "method": options.method,
        "accuracy": options.accuracy,
        "voxels": options.voxels,
        "grid": grid.model_dump(mode="json"),
        "views": {name: view.model_dump() for name, view in results[0].views.items()},
        "volumes": [volume.model_dump(mode="json") for result in results for volume in result.volumes],
        "cpu_s": sum(result.cpu_s for result in results),
        "peak_rss_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def _tell_slow_views(result: ShotResult) -> None:
    for name, view in result.views.items():
        if view.reason:
            nodes = f"nodes {view.node_spacing_voxel} voxels apart"
            progress(f"{name} takes the exact way, which is slower ({nodes}): {view.reason}")


def _tell_blind_views(result: ShotResult) -> None:
    for volume in result.volumes:
        for name in volume.blind_views:
            progress(
                f"shot {volume.shot}, exposure {volume.frame}: {name} sees nothing; "
                "is the shot empty, or a lens covered, a light off?"
            )


def parse_grid(text: str, calibration: Calibration) -> VoxelGrid:
    """Grid of ``X0:X1,Y0:Y1,Z0:Z1[@PITCH]``, all in mm; without a pitch the default grid's.

    Raises
    ------
    PipelineError
        The text is not of that form, or the box is empty or beyond all measure.
    """
    extent = rf"({NUMBER}):({NUMBER})"
    match = re.fullmatch(rf"{extent},{extent},{extent}(?:@({NUMBER}))?", text)
    if not match:
        raise PipelineError(f"--grid {text!r} is not of the form X0:X1,Y0:Y1,Z0:Z1[@PITCH] in mm")
    *bounds_mm, pitch = match.groups()
    lower_mm, upper_mm = np.array(bounds_mm, dtype=float).reshape(3, 2).T
    pitch_mm = float(pitch) if pitch else default_grid(calibration).pitch_mm
    if (upper_mm <= lower_mm).any() or pitch_mm <= 0:
        raise PipelineError(f"--grid {text!r}: every range must grow, and the pitch must be positive")
    nx, ny, nz = (round(float(extent_mm) / pitch_mm) + 1 for extent_mm in upper_mm - lower_mm)
    if nx * ny * nz > MAX_VOXELS:
        raise PipelineError(
            f"--grid {text!r}: {nx:.3g} x {ny:.3g} x {nz:.3g} voxels, at most {MAX_VOXELS:.1g} are taken"
        )
    return VoxelGrid((nz, ny, nx), (float(lower_mm[0]), float(lower_mm[1]), float(lower_mm[2])), pitch_mm)


def selected_shots(run_dir: Path, selection: str | None) -> list[int]:
    """Valid sample shots within A:B; one that was flagged while recording is left out, one that is torn is an error."""
    first, last = _bounds(selection)
    with RunReader(run_dir) as run:
        keys = dict(enumerate(run.image_keys().tolist()[:last]))
        wanted = {index: key for index, key in keys.items() if index >= first}
        for index in (index for index, key in wanted.items() if key == ImageKey.INVALID):
            run.read_shot(index)
            progress(f"{run_dir.name}: shot {index} is invalid, left out")
    chosen = [index for index, key in wanted.items() if key == ImageKey.SAMPLE]
    if not chosen:
        raise PipelineError(f"{run_dir}: has no valid sample shots" + (f" in {selection}" if selection else ""))
    return chosen


def _bounds(selection: str | None) -> tuple[int, int | None]:
    match = re.fullmatch(r"(\d*):(\d*)", selection or ":")
    if not match:
        raise PipelineError(f"--shots {selection!r} is not of the form A:B")
    first, last = match.groups()
    return int(first or 0), int(last) if last else None


def optics(options: Namespace) -> dict[str, Any]:
    """``tomoshadow optics``."""
    return optics_table(load_config(options.config))


def serve(options: Namespace) -> dict[str, Any]:
    """``tomoshadow serve``; the web framework is loaded only here."""
    from server.web.serve import serve_rig

    serve_rig(options.config, options.host, options.port)
    return {}


def demo(options: Namespace) -> dict[str, Any]:
    """``tomoshadow demo``; the bench is loaded only here."""
    from server.demo.demo import demonstrate
    from server.demo.demo_report import readable_summary, summary, write_demo_report

    options.out.mkdir(parents=True, exist_ok=True)
    demonstration = demonstrate(options.config, options.out, options.shots, progress, options.firmware)
    report = options.out / "report.html"
    write_demo_report(demonstration, report)
    result = summary(demonstration, report)
    progress(f"\n{readable_summary(result)}\n")
    return result
