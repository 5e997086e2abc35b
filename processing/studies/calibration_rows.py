"""What the study of calibration errors measures, and what it says of each case. Values only."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from processing.calibration.target.targets import Target
from processing.geometry import FloatArray

TARGET = Target(kind="checkerboard", columns=23, rows=17, pitch_mm=1.0)
TRUE_ERROR_LIMIT_PX, CORNER_LIMIT_PX, CORNER_LIMIT_S, DRIFT_LIMIT_PX = 0.01, 0.05, 1.0, 0.1


@dataclass(frozen=True)
class Photograph:
    """How a rendered board was photographed.

    Parameters
    ----------
    blur_px : float
        Standard deviation of blur on top of diffraction and defocus.
    noise : float
        Standard deviation, relative to full scale.
    unevenness : float
        By how much the light falls off towards a corner.
    """

    blur_px: float = 0.0
    noise: float = 0.002
    unevenness: float = 0.0


PHOTOGRAPHS: Mapping[str, Photograph] = MappingProxyType(
    {
        "sharp": Photograph(),
        "blur 1.5 px": Photograph(blur_px=1.5),
        "noise 1 %": Photograph(noise=0.01),
        "uneven light": Photograph(unevenness=0.8),
        "blur, noise and uneven light": Photograph(1.5, 0.01, 0.8),
    }
)


@dataclass(frozen=True)
class CalibrationStudy:
    """What to measure; the defaults are the paper's rig.

    Parameters
    ----------
    views : tuple of str
        Views to measure; all four see the droplets.
    z_mm : tuple of float
        Positions of the target.
    noise_px : float
        Noise of corners, per coordinate.
    fits : int
        Fits of every camera, each with noise of its own.
    principal_offset_px : tuple[float, float]
        How far the optical axis lies from the middle of the image; to the other side in views from the other side.
    binning : int
        Of the rendered boards; 1 is the paper's resolution.
    photographs : tuple of str
        Names of ``PHOTOGRAPHS``.
    half_mm : tuple[float, float, float]
        Half-widths of the box with droplets; the paper's volume is 9 mm deep.
    densities_per_mm3 : tuple of float
        Of droplets.
    shots : int
        Shots of droplets that self-calibration takes together.
    watched_shots : int
        Shots that the watch looks at one by one; at least one per view.
    drift_px : float
        How far one camera has moved; every view in a direction of its own.
    seed : int
        Of all noise.
    """

    views: tuple[str, ...] = ("view1", "view2", "view3", "view4")
    z_mm: tuple[float, ...] = tuple(float(z) for z in np.linspace(-4.5, 4.5, 10))
    noise_px: float = 0.05
    fits: int = 5
    principal_offset_px: tuple[float, float] = (250.0, -100.0)
    binning: int = 1
    photographs: tuple[str, ...] = tuple(PHOTOGRAPHS)
    half_mm: tuple[float, float, float] = (2.5, 2.0, 4.5)
    densities_per_mm3: tuple[float, ...] = (3.5, 7.0)
    shots: int = 4
    watched_shots: int = 12
    drift_px: float = 2.0
    seed: int = 0


@dataclass(frozen=True)
class CalibrationRow:
    """One figure of one view.

    Parameters
    ----------
    quantity : str
        What was measured: ``true error``, ``corner error``, ``corner time``, ``disparity error`` or ``drift error``.
    case : str
        Model and region, photograph, or density of droplets.
    view : str
        Name of the view.
    value : float | None
        Root mean square of this view in px, or CPU time in s; None where the product refused.
    maximum : float | None
        Largest error in px, of a drift in any view; None for times and refusals.
    limit : float
        What the value, of a drift the largest error, must not exceed.
    kept : bool
        Whether it does not; of disparities, whether alarms are right in every shot too.
    within : float | None
        Share of the errors that do not exceed the limit; None where single figures are judged.
    ideal_rms, ideal_maximum : float | None
        Of true errors: root mean square, and the largest to be expected of as many fits, that the best unbiased fits
        leave (bound of Cramér and Rao).
    ideal_fits_within : float | None
        Share of those best fits of which no error anywhere exceeds the limit.
    """

    quantity: str
    case: str
    view: str
    value: float | None
    maximum: float | None
    limit: float
    kept: bool
    within: float | None = None
    ideal_rms: float | None = None
    ideal_maximum: float | None = None
    ideal_fits_within: float | None = None


def error_row(quantity: str, case: str, view: str, error_px: FloatArray, limit_px: float) -> CalibrationRow:
    """Row of errors, in an array of any shape, whose root mean square has a limit."""
    value_px, within = rms_px(error_px), float((error_px <= limit_px).mean())
    return CalibrationRow(quantity, case, view, value_px, float(error_px.max()), limit_px, value_px <= limit_px, within)


def rms_px(error_px: FloatArray) -> float:
    """Root mean square of errors of any shape."""
    return float(np.sqrt((error_px**2).mean()))


def of_quantity(rows: Sequence[CalibrationRow], quantity: str) -> list[CalibrationRow]:
    """Rows of one quantity."""
    return [row for row in rows if row.quantity == quantity]
