"""Which light explains an exposure best: from all directions, from as few as a condenser lets through, or any, blurred.

A lens that is sharp shows diffraction, and how that looks depends on how many directions light comes from: on the
aperture of the light over that of the lens. Of a lens that is not, a Gaussian blur is all that is seen.

Droplets vote. What is left of the images as a whole is left by ligaments and by droplets that overlap, whatever the
light; of most droplets only the light decides how well they are explained. Lights from 1.8 apertures up to all
directions look alike, and diameters differ by 4 um: of lights that explain droplets equally well the middle one is
taken, and how far radii differ among them is told.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from processing.analysis.droplets.shadows.disc_profiles import disc_profiles
from processing.analysis.droplets.shadows.opaque_discs import Discs
from processing.analysis.droplets.shadows.shadow_fit import ShadowFit
from processing.coherent_light import MOST_RATIO
from processing.geometry import FloatArray

NamedLight = Literal["estimated", "incoherent", "gaussian"]
Light = Annotated[float, Field(gt=0, le=MOST_RATIO)] | NamedLight
"""The aperture of the light over that of the lens; from all directions; whatever is behind a Gaussian blur; or
whichever of them explains the images best."""
CONDENSER_RATIOS = (MOST_RATIO, 3.0, 1.8, 1.3, 1.15, 1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2)
"""That are tried, from the least to the most coherent."""
FIRST_TRIED = (MOST_RATIO, 0.9, 0.8, 0.7)
"""One of them is better than a Gaussian blur wherever any is: around 0.8 discs look much like larger, sharper ones."""
UNSURE, SURE = 1 / 3, 2 / 3
"""Shares of the droplets that must be explained better, to be unsure of the light, and to be sure that it shows.

Of simulated shots 0 to 20 % were behind a Gaussian blur, 73 to 100 % in light that shows.
"""
LEAST_BLUR_PX = 0.6
"""Of views in the mean: pixels that are wider leave edges by which a Gaussian blur looks like light."""
LEAST_DROPLETS = 10
"""That vote; blur is taken as Gaussian where there are fewer."""
LEAST_SIZE, MOST_SIZE = 0.75, 1.33
"""Of radii in another light, relative: small discs are as dark."""
ALIKE = 0.01
"""Lights leave alike where the logarithms of what they leave differ by less, in the mean of the droplets."""
DRAWS = 200
"""Of droplets with replacement."""


def stated_ratio(light: "float | NamedLight") -> float | None:
    """Condenser ratio of a light that is not to be estimated; None: a Gaussian blur."""
    named = {"gaussian": None, "incoherent": MOST_RATIO}
    return named[light] if isinstance(light, str) else light


@dataclass(frozen=True, eq=False)
class Relit:
    """Droplets in some light.

    Parameters
    ----------
    squares : (N,) array
        What is left around each, squared.
    radii : (N,) array
        Radii, in any unit.
    """

    squares: FloatArray
    radii: FloatArray


@dataclass(frozen=True)
class SeenLight:
    """What droplets say of the light.

    Parameters
    ----------
    condenser_ratio : float | None
        Numerical aperture of the light over that of the lens; None: it does not show behind a Gaussian blur.
    share : float
        Of the droplets, which this light, or the best one, explains better than a Gaussian blur does.
    radius_sd : float
        Standard deviation that all radii share because the light is not known better, in the unit of the radii.
    """

    condenser_ratio: float | None = None
    share: float = 0.0
    radius_sd: float = 0.0


def light_doubts(share: float, droplets: int) -> tuple[str, ...]:
    """What speaks against diameters in an estimated light.

    Parameters
    ----------
    share : float
        Of the droplets, which a light that shows explains better than a Gaussian blur does.
    droplets : int
        How many.
    """
    if not droplets or share >= SURE or (droplets >= LEAST_DROPLETS and share <= UNSURE):
        return ()
    few = f": fewer than {LEAST_DROPLETS} do not vote" if droplets < LEAST_DROPLETS else ""
    return (
        f"which light this is cannot be told from these droplets{few}, and diameters may be up to 10 um wrong; state "
        "what is known of the rig (--light: aperture of the light over that of the lens; incoherent; or gaussian, of a "
        "lens that is not sharp)",
    )


def seen_light(relit: Callable[[float | None], Relit], *, resolved: bool = True) -> SeenLight:
    """The light that explains most droplets best.

    Parameters
    ----------
    relit : callable
        Of a condenser ratio, or None for a Gaussian blur: the droplets in that light.
    resolved : bool
        Whether pixels are fine enough to tell; else droplets can only be unsure of the light.
    """
    blurred = relit(None).squares
    if len(blurred) < LEAST_DROPLETS:
        return SeenLight()
    tried = {ratio: relit(ratio) for ratio in FIRST_TRIED}
    if (share := float(np.mean(tried[_best(tried)].squares < blurred))) < SURE or not resolved:
        return SeenLight(None, min(share, 0.5 * (UNSURE + SURE)) if not resolved else share)
    while unknown := [ratio for ratio in _next_ratios(tried) if ratio not in tried]:
        tried |= {ratio: relit(ratio) for ratio in unknown}
    ratio, radius_sd = _middle(tried)
    return SeenLight(ratio, float(np.mean(tried[ratio].squares < blurred)), radius_sd)


def _left(tried: Mapping[float, Relit]) -> FloatArray:
    """Logarithms (lights, N) of what is left: droplets that nothing explains have no more say than others."""
    return np.log(np.maximum([one.squares for one in tried.values()], 1e-12))


def _best(tried: Mapping[float, Relit]) -> float:
    return list(tried)[int(_left(tried).mean(axis=1).argmin())]


def _middle(tried: Mapping[float, Relit]) -> tuple[float, float]:
    """The middle one of the lights that leave about the least, and the standard deviation of radii among them.

    They are those that leave alike, and those that other draws of the same droplets would have found best.
    """
    left, ratios = _left(tried), list(tried)
    draws = np.random.default_rng(0).integers(0, left.shape[1], (DRAWS, left.shape[1]))
    chosen = left[:, draws].mean(axis=2).argmin(axis=0)
    larger = np.array([np.median(one.radii - tried[_best(tried)].radii) for one in tried.values()])
    alike = np.flatnonzero(left.mean(axis=1) < left.mean(axis=1).min() + ALIKE)
    middle = 0.5 * (larger[alike].min() + larger[alike].max())
    taken = alike[np.abs(larger[alike] - middle).argmin()]
    by_draws = np.sqrt(np.mean((larger[chosen] - larger[taken]) ** 2))
    return ratios[taken], float(max(by_draws, np.abs(larger[alike] - larger[taken]).max()))


def _next_ratios(tried: Mapping[float, Relit]) -> list[float]:
    """Neighbours of the best ratio; where they are known, the vertex of the parabola through all three."""
    best = _best(tried)
    if best not in CONDENSER_RATIOS:
        return []
    number = CONDENSER_RATIOS.index(best)
    around = CONDENSER_RATIOS[max(number - 1, 0) : number + 2]
    unknown = [ratio for ratio in around if ratio not in tried]
    if unknown or len(around) < 3:
        return unknown
    left = _left({ratio: tried[ratio] for ratio in around}).mean(axis=1)
    bend, slope, _ = np.polyfit([1 / ratio for ratio in around], left, 2)
    return [float(f"{-2 * bend / slope:.2g}")]


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
