"""Whether droplets explain the images, and views lie where their calibration says."""

from collections.abc import Mapping
from dataclasses import dataclass

from processing.analysis.droplets.measured_exposure import ShotVerdict

MOST_SHIFT_PX = 0.3
"""Views that lie farther beside their calibration are refused."""
EVEN, MOSTLY = 1.05, 0.9
"""Where more than so many times the noise is left, so large a share of what views see must be explained by droplets."""
SMOOTHED = "were images resampled, filtered or taken in colour, so that neighbouring pixels share their noise"
"""Noise is told by how neighbours differ: what is left would be noise, too."""


@dataclass(frozen=True)
class RatioLimits:
    """Of residual over noise.

    Parameters
    ----------
    trusted : float
        Ghosts are not told from droplets from here on.
    refused : float
        Nothing is believed from here on.
    """

    trusted: float
    refused: float


def judged(
    beside_px: Mapping[str, float], ratio: float, bare: float, limits: RatioLimits
) -> tuple[ShotVerdict, tuple[str, ...]]:
    """Verdict and reasons, by residual over noise and by how far views lie beside their calibration.

    Where droplets do not explain the images, how far these lie beside is no more than a guess, and not told.

    Parameters
    ----------
    beside_px : dict of name to float
        How far views lie beside their calibration.
    ratio, bare : float
        Residual over noise, with all droplets and without any.
    limits : RatioLimits
        Of the ratio.
    """
    if reasons := _refusals(beside_px, ratio, limits.refused):
        return ShotVerdict.REFUSED, reasons
    if reason := _doubt(ratio, bare, limits.trusted):
        return ShotVerdict.DOUBTFUL, (reason,)
    return ShotVerdict.GOOD, ()


def _refusals(beside_px: Mapping[str, float], ratio: float, limit: float) -> tuple[str, ...]:
    if ratio >= limit:
        return (
            f"droplets explain the images to {ratio:.2f} times the noise only, limit {limit}: do calibration and views "
            "belong together (tomoshadow check), is the spray too dense, are droplets seen outside of what was "
            f"searched, or {SMOOTHED}?",
        )
    return tuple(
        f"{name} lies {shift_px:.2f} px beside its calibration, limit {MOST_SHIFT_PX} px: correct it by the droplets "
        "(tomoshadow self-calibrate) or calibrate again"
        for name, shift_px in beside_px.items()
        if shift_px > MOST_SHIFT_PX
    )


def _doubt(ratio: float, bare: float, limit: float) -> str:
    """Why what droplets leave unexplained casts doubt on them; empty where it does not."""
    if ratio >= limit:
        return (
            f"droplets explain the images to {ratio:.2f} times the noise, more than {limit}: how many are ghosts "
            f"cannot be told; or {SMOOTHED}?"
        )
    if ratio < EVEN or (share := (bare**2 - ratio**2) / (bare**2 - 1)) >= MOSTLY:
        return ""
    return (
        f"droplets explain {100 * max(0.0, share):.0f} % of what views see beyond their noise, limit "
        f"{100 * MOSTLY:.0f} %: the rest is too small or too faint to be told as droplets, and missing in number "
        "density and mean sizes"
    )
