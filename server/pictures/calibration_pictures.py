"""Pictures of a calibration: the assigned grid, error vectors, and residuals."""

from pathlib import Path

from processing.calibration.calibration import Calibration
from processing.calibration.observation import CalibrationSet
from processing.calibration.sets.target_image import target_image
from processing.figures.calibration_figures import error_vectors_figure, grid_figure
from processing.figures.residual_figures import residuals_figure


def picture_paths(calibration_file: Path) -> tuple[Path, Path]:
    """Where the assigned grid and the error vectors go."""
    grid, errors = (calibration_file.with_name(f"{calibration_file.stem}-{kind}.png") for kind in ("grid", "errors"))
    return grid, errors


def calibration_pictures(
    source: Path, calibration_set: CalibrationSet, calibration: Calibration, calibration_file: Path
) -> list[Path]:
    """Draw ``NAME-grid.png``, where the set has images, and ``NAME-errors.png``, where the world is known."""
    written = []
    grid, errors = picture_paths(calibration_file)
    planes = {name: seen.planes[len(seen.planes) // 2] for name, seen in calibration_set.views.items()}
    found = {name: target_image(source, name, plane) for name, plane in planes.items()}
    images = {name: image for name, image in found.items() if image is not None}
    if images:
        written.append(grid)
        grid_figure(images, planes).savefig(written[-1], dpi=100)
    if not any(view.intrinsics_only for view in calibration.views.values()):
        written.append(errors)
        error_vectors_figure(calibration_set, calibration).savefig(written[-1], dpi=100)
    return written


def store_pictures(source: Path, calibration_set: CalibrationSet, calibration: Calibration, folder: Path) -> None:
    """Draw ``residuals.png``, ``errors.png``, and ``grid-N.png`` for every plane, into a folder of their own."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.png"):
        old.unlink()
    residuals_figure(calibration).savefig(folder / "residuals.png", dpi=100)
    if not any(view.intrinsics_only for view in calibration.views.values()):
        error_vectors_figure(calibration_set, calibration).savefig(folder / "errors.png", dpi=100)
    for number in range(max(len(seen.planes) for seen in calibration_set.views.values())):
        planes = {
            name: seen.planes[number] for name, seen in calibration_set.views.items() if len(seen.planes) > number
        }
        found = {name: target_image(source, name, plane) for name, plane in planes.items()}
        if images := {name: image for name, image in found.items() if image is not None}:
            grid_figure(images, planes).savefig(folder / f"grid-{number + 1}.png", dpi=80)
