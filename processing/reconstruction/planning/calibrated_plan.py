"""Grid and plan of calibrated views: where they can be trusted, and where they see a grid."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from processing.calibration.calibration import Calibration
from processing.reconstruction.choices import Accuracy
from processing.reconstruction.errors import RoughMapping
from processing.reconstruction.planning.common_volume import common_volume, too_coarse
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
    return calibrated_plan(calibration, grid, views, settings.accuracy)


def calibrated_plan(calibration: Calibration, grid: VoxelGrid, views: Sequence[str], accuracy: Accuracy) -> Plan:
    """Where these views see a grid; as ``plan_reconstruction``, with the names of a calibration."""
    mappings = [calibration.views[view].mapping for view in views]
    with telling_where(calibration, grid):
        return plan_reconstruction(mappings, grid, accuracy, views)


def told_coarse(calibration: Calibration, grid: VoxelGrid, views: Sequence[str] | None = None) -> str:
    """What to say of voxels that are too wide for these views, see ``too_coarse``; empty where they are not."""
    return too_coarse([calibration.views[view].mapping for view in views or calibration.views], grid)


@contextmanager
def telling_where(calibration: Calibration, grid: VoxelGrid) -> Iterator[None]:
    """Say of a grid on which a mapping runs away how far outside of what was calibrated it lies, if it does."""
    try:
        yield
    except RoughMapping as error:
        spans_mm = (calibration.x_range_mm, calibration.y_range_mm, calibration.z_range_mm)
        reached_mm = [(float(along_mm[0]), float(along_mm[-1])) for along_mm in (grid.x_mm, grid.y_mm, grid.z_mm)]
        if not any(_is_far(*both) for both in zip(spans_mm, reached_mm, strict=True)):
            raise
        raise RoughMapping(
            f"the grid, {_box(reached_mm)} mm, lies far outside of what was calibrated, {_box(spans_mm)} mm: there no "
            "mapping is known; is it in mm, and where the target was?"
        ) from error


def _is_far(span_mm: tuple[float, float], reached_mm: tuple[float, float]) -> bool:
    """Whether a grid reaches beyond a span by more than that is wide."""
    return max(span_mm[0] - reached_mm[0], reached_mm[1] - span_mm[1]) > span_mm[1] - span_mm[0]


def _box(spans_mm: Sequence[tuple[float, float]]) -> str:
    return ", ".join(f"{axis} {low:.4g} to {high:.4g}" for axis, (low, high) in zip("xyz", spans_mm, strict=True))


def _widened(span_mm: tuple[float, float]) -> tuple[float, float]:
    quarter_mm = (span_mm[1] - span_mm[0]) / 4
    return span_mm[0] - quarter_mm, span_mm[1] + quarter_mm
