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
DRAWS = 100
"""Of droplets with replacement."""
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
            "exposure, or are droplets not opaque? Diameters are too small then, and the number may be wrong",
        )


def black_doubts(shot: Transmissions, search: DropletSearch, fit: ShadowFit) -> tuple[str, ...]:
    """What the droplets say against the black level; empty where they are too few to say anything."""
    if len(fit.discs) < LEAST_DROPLETS:
        return ()
    asked = _depths(shot, fit) > PALE
    if np.count_nonzero(asked) < LEAST_DROPLETS:
        asked = np.ones(len(asked), np.bool_)
    return black_level(lambda share: _left(shot, search, fit, share)[asked]).doubts


def black_level(left: Callable[[float], FloatArray]) -> BlackLevel:
    """The level that leaves least: the vertex of a parabola through the best one and its neighbours.

    Parameters
    ----------
    left : callable
        What is left around each of N droplets, squared, if so much of the light were no light of the images.
    """
    tried = {step: np.log(np.maximum(left(step * STEP), 1e-12)) for step in (-1, 0, 1)}
    while (step := _next(tried)) is not None:
        tried[step] = np.log(np.maximum(left(step * STEP), 1e-12))
    best = min(max(_best(tried), min(tried) + 1), max(tried) - 1)
    around = np.array([tried[best + aside] for aside in (-1, 0, 1)])
    number = around.shape[1]
    draws = np.random.default_rng(0).integers(0, number, (DRAWS, number))
    return BlackLevel(
        STEP * float(best + _vertex(around.mean(axis=1))), STEP * float(np.std(_vertex(around[:, draws].mean(axis=2))))
    )


def _best(tried: dict[int, FloatArray]) -> int:
    return min(tried, key=lambda step: float(tried[step].mean()))


def _next(tried: dict[int, FloatArray]) -> int | None:
    """The step beyond the best one, if that is the last on its side; None where both neighbours are known."""
    best = _best(tried)
    beyond = [step for step in (best - 1, best + 1) if LOWEST <= step <= HIGHEST and step not in tried]
    return beyond[0] if beyond else None


def _vertex(around: FloatArray) -> FloatArray:
    """Of parabolas through what is left one step before, at, and one step beyond (3, ...), in steps; 1 at most."""
    before, at, beyond = around
    bend = np.maximum(before + beyond - 2 * at, 1e-12)
    vertex: FloatArray = np.clip(0.5 * (before - beyond) / bend, -1.0, 1.0)
    return vertex


def _left(shot: Transmissions, search: DropletSearch, fit: ShadowFit, share: float) -> FloatArray:
    """What is left around each droplet, squared, if such a share of the light were none of it."""
    views = zip(shot.images, fit.optics.levels, strict=True)
    images = tuple(((image - np.float32(share * level)) / np.float32(1 - share)) for image, level in views)
    begun = replace(fit, discs=_deeper(shot, fit, share), noises=fit.noises / (1 - share))
    return ShadowRounds(replace(shot, images=images), search).left_around(begun)


def _deeper(shot: Transmissions, fit: ShadowFit, share: float) -> Discs:
    """Discs about as large as they must be to be as dark behind a veil: where a fit begins."""
    depths = _depths(shot, fit)
    deeper = -np.log(1 - np.minimum(depths / (1 - share), DEEPEST)) * _wide_voxel2(shot, fit)
    return Discs(fit.discs.positions_voxel, np.where(depths < LARGE, deeper, fit.discs.squares_voxel2))


def _depths(shot: Transmissions, fit: ShadowFit) -> FloatArray:
    """Share of the light that each disc takes at its centre, (N,)."""
    return np.asarray(1 - np.exp(-fit.discs.squares_voxel2 / _wide_voxel2(shot, fit)))


def _wide_voxel2(shot: Transmissions, fit: ShadowFit) -> FloatArray:
    """Twice the variance of the blur at each disc, mean of the views, (N,)."""
    blurs_px = fit.optics.blurs_px(fit.discs.positions_voxel[:, 2]).mean(axis=0)
    return np.asarray(2 * (blurs_px / shot.lattice.pixels_per_voxel) ** 2)
