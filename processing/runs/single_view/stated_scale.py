"""Is a pixel as wide as was said? Of a single view only the magnification of its rig contradicts it."""

from daq.files.header import RunHeader
from processing.calibration.fit.scale_check import SCALE_TOLERANCE
from processing.calibration.sets.recorded_set import nominal_scales


def rig_um_per_px(header: RunHeader, view: str) -> float | None:
    """Width of a pixel in the spray by magnification and pixels of the rig; None for images from elsewhere."""
    scale_px_per_mm = nominal_scales(header.configuration).get(view)
    return None if scale_px_per_mm is None else 1000 / scale_px_per_mm


def scale_doubts(stated_um_per_px: float | None, by_rig_um_per_px: float | None) -> tuple[str, ...]:
    """What speaks against a stated width of a pixel."""
    if stated_um_per_px is None or by_rig_um_per_px is None:
        return ()
    if 1 / (1 + SCALE_TOLERANCE) < stated_um_per_px / by_rig_um_per_px < 1 + SCALE_TOLERANCE:
        return ()
    return (
        f"a pixel is stated to be {stated_um_per_px:g} um wide, and magnification and pixels of the rig make "
        f"{by_rig_um_per_px:.3g} um of it: all lengths are in proportion",
    )
