"""Where black is: how much of the light shadows keep, by a black level, stray light, a gamma, or a second exposure.

Discs that are larger than their blur are black in their middle, and that is asked (``shadow_light.grey``). Smaller ones
never are: behind a veil of light they look smaller, below black larger, and with another blur they explain the images
nearly as well as ever. But not quite: they are fitted anew at several levels, and the one that leaves least is told.
Pale shadows have no say: those that a second flash makes are told as small droplets, and fit best below black.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from processing.analysis.droplets.droplet_search import DropletSearch
from processing.analysis.droplets.shadows.discs.opaque_discs import Discs
from processing.analysis.droplets.shadows.least_left import least_left
from processing.analysis.droplets.shadows.light.seen_light import LEAST_DROPLETS
from processing.analysis.droplets.shadows.shadow_fit import ShadowFit, Transmissions
from processing.analysis.droplets.shadows.shadow_rounds import ShadowRounds
from processing.geometry import FloatArray

STEP = 0.08
"""Of the light, from one level that is tried to the next."""
LOWEST, HIGHEST = -2, 5
"""Steps that are tried at most."""
MOST = 0.03
"""Of the light: mean diameters are 1.5 % wrong then. Of simulated shots, in any light, -0.02 to 0.01 is told where
black is black."""
SURE = 2.0
"""Standard deviations."""
PALE = 0.25
"""Of the light, that a shadow takes at most at its centre which has no say where enough others have one."""
DEEPEST = 0.97
"""Of the light, that a disc takes at its centre when its fit begins; those above ``LARGE`` are as large as before."""
LARGE = 0.9


@dataclass(frozen=True)
class BlackLevel:
    """How much of the light is left where none should be.

    Parameters
    ----------
    share, sd : float
        Of the light, with its standard deviation. Negative: shadows are below black.
    """

    share: float
    sd: float

    @property
    def doubts(self) -> tuple[str, ...]:
        """What speaks against diameters."""
        if abs(self.share) <= MOST + SURE * self.sd:
            return ()
        told = f"{100 * abs(self.share):.0f} % of the light"
        limit = f"limit {100 * MOST:.0f} %"
        if self.share < 0:
            return (
                f"shadows are {told} below black, {limit}: is the dark image brighter than the camera's black level "
                "(did light fall on it, or was it taken with another exposure time or gain), or are images processed? "
                "Diameters are too large then",
            )
        return (
            f"shadows look as if behind a veil of {told}, {limit}: is a dark image missing (the camera's black level), "
            "is there stray light, are grey values not in proportion to light (gamma), is the light on twice within an "
            "exposure, or are droplets not opaque, as those that pass light in their middle? Diameters are too small "
            "then, and the number may be wrong",
        )


def black_doubts(shot: Transmissions, search: DropletSearch, fit: ShadowFit) -> tuple[str, ...]:
    """What the droplets say against the black level; empty where they are too few to say anything."""
    if len(fit.discs) < LEAST_DROPLETS:
        return ()
    asked = depths(shot, fit) > PALE
    if np.count_nonzero(asked) < LEAST_DROPLETS:
        asked = np.ones(len(asked), np.bool_)
    return black_level(lambda share: _left(shot, search, fit, share)[asked]).doubts


def black_level(left: Callable[[float], FloatArray]) -> BlackLevel:
    """The level that leaves least.

    Parameters
    ----------
    left : callable
        What is left around each of N droplets, squared, if so much of the light were no light of the images.
    """
    found = least_left(lambda step: left(step * STEP), LOWEST, HIGHEST)
    return BlackLevel(STEP * found.step, STEP * found.sd)


def _left(shot: Transmissions, search: DropletSearch, fit: ShadowFit, share: float) -> FloatArray:
    """What is left around each droplet, squared, if such a share of the light were none of it."""
    views = zip(shot.images, fit.optics.levels, strict=True)
    images = tuple(((image - np.float32(share * level)) / np.float32(1 - share)) for image, level in views)
    begun = replace(fit, discs=_deeper(shot, fit, share), noises=fit.noises / (1 - share))
    return ShadowRounds(replace(shot, images=images), search).left_around(begun)


def _deeper(shot: Transmissions, fit: ShadowFit, share: float) -> Discs:
    """Discs about as large as they must be to be as dark behind a veil: where a fit begins."""
    taken = depths(shot, fit)
    deeper = -np.log(1 - np.minimum(taken / (1 - share), DEEPEST)) * _wide_voxel2(shot, fit)
    return Discs(fit.discs.positions_voxel, np.where(taken < LARGE, deeper, fit.discs.squares_voxel2))


def depths(shot: Transmissions, fit: ShadowFit) -> FloatArray:
    """Share of the light that each disc takes at its centre, (N,)."""
    return np.asarray(1 - np.exp(-fit.discs.squares_voxel2 / _wide_voxel2(shot, fit)))


def _wide_voxel2(shot: Transmissions, fit: ShadowFit) -> FloatArray:
    """Twice the variance of the blur at each disc, mean of the views, (N,)."""
    blurs_px = fit.optics.blurs_px(fit.discs.positions_voxel[:, 2]).mean(axis=0)
    return np.asarray(2 * (blurs_px / shot.lattice.pixels_per_voxel) ** 2)
