"""Grid as a person states it: ranges of x, y and z in mm."""

import re

import numpy as np

from processing.calibration.calibration import Calibration
from processing.decimal_text import NUMBER
from processing.reconstruction.planning.calibrated_plan import default_grid
from processing.reconstruction.settings import MAX_VOXELS
from processing.runs.errors import PipelineError
from processing.volume import VoxelGrid

_RANGE = rf"({NUMBER}):({NUMBER})"
_FORM = re.compile(rf"{_RANGE},{_RANGE},{_RANGE}(?:@({NUMBER}))?")


def parse_grid(text: str, calibration: Calibration, name: str = "--grid") -> VoxelGrid:
    """Grid of ``X0:X1,Y0:Y1,Z0:Z1[@PITCH]``, all in mm; without a pitch the default grid's.

    Parameters
    ----------
    name : str
        What the text is called where it was stated.

    Raises
    ------
    PipelineError
        The text is not of that form, or the box is empty or beyond all measure.
    """
    match = _FORM.fullmatch(text)
    if not match:
        raise PipelineError(f"{name} {text!r} is not of the form X0:X1,Y0:Y1,Z0:Z1[@PITCH] in mm, as -2:2,-1:1.5,-1:1")
    *bounds_mm, pitch = match.groups()
    lower_mm, upper_mm = np.array(bounds_mm, dtype=float).reshape(3, 2).T
    pitch_mm = float(pitch) if pitch else default_grid(calibration).pitch_mm
    if (upper_mm <= lower_mm).any() or pitch_mm <= 0:
        raise PipelineError(f"{name} {text!r}: every range must grow, and the pitch must be positive")
    nx, ny, nz = (round(float(extent_mm) / pitch_mm) + 1 for extent_mm in upper_mm - lower_mm)
    if nx * ny * nz > MAX_VOXELS:
        raise PipelineError(
            f"{name} {text!r}: {nx:.3g} x {ny:.3g} x {nz:.3g} voxels, at most {MAX_VOXELS:.1g} are taken"
        )
    return VoxelGrid((nz, ny, nx), (float(lower_mm[0]), float(lower_mm[1]), float(lower_mm[2])), pitch_mm)
