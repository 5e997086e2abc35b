"""The image that a plane of a calibration set was found in."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from processing.calibration.observation import PlaneObservation
from processing.calibration.sets.calibration_set import SET_FILE
from processing.calibration.sets.recorded_set import mean_target_images
from processing.calibration.sets.set_record import SetRecord
from processing.image_file import read_image


def target_image(path: Path, view: str, plane: PlaneObservation) -> NDArray[np.generic] | None:
    """Image of one view and plane; None where points were measured elsewhere.

    Parameters
    ----------
    path : Path
        Calibration run or set, as ``load_calibration_set`` takes it.
    view : str
        Name of the view.
    plane : PlaneObservation
        A plane of that set.
    """
    if (path / "run.h5").exists():
        return None if plane.z_mm is None else mean_target_images(path, plane.z_mm)[view]
    folder = path if (path / SET_FILE).exists() else path / "calibration"
    entry = SetRecord.model_validate_json((folder / SET_FILE).read_text(encoding="utf-8")).calibration
    files = [file for one in entry.plane for camera, file in one.images.items() if camera == view]
    files += [points.image for points in entry.points if points.image and points.camera == view]
    return next((read_image(folder / file) for file in files if plane.name.startswith(Path(file).name)), None)
