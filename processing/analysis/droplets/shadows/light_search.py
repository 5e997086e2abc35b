"""Which light explains an exposure best: from all directions, or from as few as a condenser lets through.

Droplets vote. What is left of the images as a whole is left by ligaments and by droplets that overlap, whatever the
light; of most droplets only the light decides how well they are explained.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from processing.analysis.droplets.shadows.disc_profiles import disc_profiles
from processing.analysis.droplets.shadows.opaque_discs import Discs
from processing.analysis.droplets.shadows.shadow_fit import ShadowFit
from processing.geometry import FloatArray

Light = Annotated[float, Field(gt=0, le=1)] | Literal["estimated", "incoherent"]
"""The aperture of the light over that of the lens, light from all directions, or whichever explains the images best."""
CONDENSER_RATIOS = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2)
"""That are tried, from the least to the most coherent."""
FIRST_TRIED = (0.9, 0.8, 0.7)
"""One of them is better than incoherent light wherever any is: around 0.8 discs look much like larger, sharper ones."""
FINEST_RATIO = 0.02
"""Step of the last guess: each ratio has a table of its own."""
UNSURE, SURE = 1 / 3, 2 / 3
"""Shares of the droplets that must be explained better, to be unsure of the light, and to be sure that it is coherent.

Of simulated shots 1 to 20 % were in incoherent light, 73 to 100 % in coherent light.
"""
LEAST_DROPLETS = 10
"""That vote; light is taken as incoherent where there are fewer."""
LEAST_SIZE, MOST_SIZE = 0.75, 1.33
"""Of radii in another light, relative: small discs are as dark."""


@dataclass(frozen=True)
class SeenLight:
    """What droplets say of the light.

    Parameters
    ----------
    condenser_ratio : float | None
        Numerical aperture of the light over that of the lens; None: incoherent.
    share : float
        Of the droplets, which coherent light explains better than incoherent light does.
    """

    condenser_ratio: float | None = None
    share: float = 0.0


def seen_light(residuals: Callable[[float | None], FloatArray]) -> SeenLight:
    """The light that explains most droplets best.

    Parameters
    ----------
    residuals : callable
        Of a condenser ratio, or None for incoherent light: what is left around each droplet (N,), squared.
    """
    incoherent = residuals(None)
    if len(incoherent) < LEAST_DROPLETS:
        return SeenLight()
    left = {ratio: residuals(ratio) for ratio in FIRST_TRIED}
    if (share := float(np.mean(left[_best(left)] < incoherent))) < SURE:
        return SeenLight(None, share)
    while unknown := [ratio for ratio in _next_ratios(left) if ratio not in left]:
        left |= {ratio: residuals(ratio) for ratio in unknown}
    best = _best(left)
    return SeenLight(best, float(np.mean(left[best] < incoherent)))


def _best(left: Mapping[float, FloatArray]) -> float:
    return min(left, key=lambda ratio: float(np.median(left[ratio])))


def _next_ratios(left: Mapping[float, FloatArray]) -> list[float]:
    """Neighbours of the best ratio; where they are known, the vertex of the parabola through all three."""
    best = _best(left)
    if best not in CONDENSER_RATIOS:
        return []
    number = CONDENSER_RATIOS.index(best)
    around = CONDENSER_RATIOS[max(number - 1, 0) : number + 2]
    unknown = [ratio for ratio in around if ratio not in left]
    if unknown or len(around) < 3:
        return unknown
    bend, slope, _ = np.polyfit(around, [float(np.median(left[ratio])) for ratio in around], 2)
    return [round(-slope / (2 * bend) / FINEST_RATIO) * FINEST_RATIO]


def relit(fit: ShadowFit, condenser_ratio: float | None, pixels_per_voxel: float) -> ShadowFit:
    """Droplets whose edges look in another light about as they did: where a fit to it begins.

    Parameters
    ----------
    fit : ShadowFit
        In its light.
    condenser_ratio : float | None
        Of the other light.
    pixels_per_voxel : float
        Scale of the images.
    """
    shift, width = disc_profiles(fit.optics.condenser_ratio).edge
    other_shift, other_width = disc_profiles(condenser_ratio).edge
    wider = width / other_width
    blurs_voxel = fit.optics.blurs_px(fit.discs.positions_voxel[:, 2]).mean(axis=0) / pixels_per_voxel
    radii = fit.discs.radii_voxel + (shift - wider * other_shift) * blurs_voxel
    radii = np.clip(radii, LEAST_SIZE * fit.discs.radii_voxel, MOST_SIZE * fit.discs.radii_voxel)
    variances = wider**2 * fit.optics.variances_px2
    optics = replace(fit.optics, variances_px2=variances, condenser_ratio=condenser_ratio)
    return replace(fit, optics=optics, discs=Discs(fit.discs.positions_voxel, radii**2))
