"""Pictures beside a calibration file: the assigned grid, and the error vectors."""

from pathlib import Path

from processing.calibration.calibration import Calibration
from processing.calibration.observation import CalibrationSet
from processing.calibration.sets.target_image import target_image
from processing.figures.calibration_figures import error_vectors_figure, grid_figure


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
