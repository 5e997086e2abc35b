"""Grid and plan of calibrated views: where they can be trusted, and where they see a grid."""

from collections.abc import Sequence

from processing.calibration.calibration import Calibration
from processing.reconstruction.planning.common_volume import common_volume
from processing.reconstruction.planning.plan import Plan, plan_reconstruction
from processing.reconstruction.settings import ReconstructionSettings
from processing.volume import VoxelGrid


def default_grid(calibration: Calibration, pitch_mm: float | None = None) -> VoxelGrid:
    """The largest box that all views see within the calibrated z range; x and y reach a quarter beyond the target."""
    return common_volume(
        [view.mapping for view in calibration.views.values()],
        x_range_mm=_widened(calibration.x_range_mm),
        y_range_mm=_widened(calibration.y_range_mm),
        z_range_mm=calibration.z_range_mm,
        pitch_mm=pitch_mm,
    )


def plan_of(calibration: Calibration, settings: ReconstructionSettings, views: Sequence[str]) -> Plan:
    """Where these views see the grid of the settings, or the default one."""
    grid = settings.grid.to_grid() if settings.grid else default_grid(calibration)
    return plan_reconstruction([calibration.views[view].mapping for view in views], grid, settings.accuracy, views)


def _widened(span_mm: tuple[float, float]) -> tuple[float, float]:
    quarter_mm = (span_mm[1] - span_mm[0]) / 4
    return span_mm[0] - quarter_mm, span_mm[1] + quarter_mm
