"""What speaks against a calibration that no droplet tells: lengths of another lens, and what it says against itself."""

from collections.abc import Iterable

from daq.files.header import RunHeader
from processing.calibration.calibration import Calibration
from processing.calibration.droplets.disparity import measured_box
from processing.calibration.fit.health import judge
from processing.calibration.fit.scale_check import SCALE_TOLERANCE, scale_px_per_mm
from processing.calibration.sets.recorded_set import nominal_scales
from processing.calibration.verdict import Verdict


def untold_doubt(header: RunHeader, calibration: Calibration) -> str:
    """Why places and lengths may be wrong although droplets agree; empty where nothing says so.

    Parameters
    ----------
    header : RunHeader
        Of a run, whose rig may state magnification and pixels.
    calibration : Calibration
        By which its droplets are placed.
    """
    return other_scale(header, calibration) or own_doubt(calibration, header.views)


def own_doubt(calibration: Calibration, names: Iterable[str]) -> str:
    """What a calibration says against one of these views beside its hold-out error, which droplets tell anew."""
    for name in names:
        view = calibration.views.get(name)
        if view is None or view.verdict is not Verdict.WARN:
            continue
        if judge(view.holdout_error_px, view.n_rejected / max(1, view.n_rejected + view.n_points)) is not Verdict.WARN:
            return f"calibration {calibration.id} says so itself, {name}: {': '.join(('warn', *view.reasons[-1:]))}"
    return ""


def other_scale(header: RunHeader, calibration: Calibration) -> str:
    """Why lengths may be those of another lens; empty where they are not, or the run does not say its magnification."""
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
