"""Is a calibration in the scale of the images? A factor of all lengths moves no view, and no droplet tells it."""

from daq.files.header import RunHeader
from processing.calibration.calibration import Calibration
from processing.calibration.droplets.disparity import measured_box
from processing.calibration.fit.scale_check import SCALE_TOLERANCE, scale_px_per_mm
from processing.calibration.sets.recorded_set import nominal_scales


def other_scale(header: RunHeader, calibration: Calibration) -> str:
    """Why lengths may be those of another lens; empty where they are not, or the run does not say its magnification.

    Parameters
    ----------
    header : RunHeader
        Of a run, whose rig may state magnification and pixels.
    calibration : Calibration
        By which its droplets are placed.
    """
    middle_mm = measured_box(calibration).middle_mm
    for view, stated in nominal_scales(header.configuration).items():
        if view not in calibration.views:
            continue
        found = scale_px_per_mm(calibration.views[view].mapping, middle_mm)
        if not 1 / (1 + SCALE_TOLERANCE) < found / stated < 1 + SCALE_TOLERANCE:
            return (
                f"{view} has {found:.3g} px/mm by the calibration, and {stated:.3g} px/mm by magnification and pixels "
                "of the rig: is the calibration that of another lens, or is the rig file wrong? All lengths are in "
                "proportion"
            )
    return ""
