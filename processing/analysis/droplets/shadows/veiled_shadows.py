"""Whether a veil of light lies over the shadows: a black level, stray light, a gamma, a second exposure.

Discs that are larger than their blur are black in their middle, and that is asked (``shadow_light.grey``). Smaller ones
never are: a veil makes them look smaller, and behind a little more blur they explain the images as well as ever. But
not quite: so they are fitted anew as if there were a veil, and vote.
"""

from dataclasses import replace

import numpy as np

from processing.analysis.droplets.droplet_search import DropletSearch
from processing.analysis.droplets.shadows.light.seen_light import LEAST_DROPLETS
from processing.analysis.droplets.shadows.opaque_discs import Discs
from processing.analysis.droplets.shadows.shadow_fit import ShadowFit, Transmissions
from processing.analysis.droplets.shadows.shadow_rounds import ShadowRounds
from processing.geometry import FloatArray

VEIL = 0.25
"""Of the light, that is tried: it makes diameters about 6 um smaller where blur is 20 um."""
MANY = 2 / 3
"""Of the droplets. In simulated shots, sharp or blurred, of any light, 0 to 27 % are explained better by a veil where
there is none, 83 to 93 % behind a fifth of the light, 93 to 100 % behind a half, 71 to 88 % by a gamma of 0.5."""
CHANCE = 1.0
"""Over the root of their number: so far above a half few droplets must be, two standard deviations."""
DEEPEST = 0.97
"""Of the light, that a disc takes at its centre when its fit begins; those above ``LARGE`` are as large as before."""
LARGE = 0.9


def veil_doubts(shot: Transmissions, search: DropletSearch, fit: ShadowFit) -> tuple[str, ...]:
    """What speaks against diameters where most droplets look as if a veil lay over them; empty where few do."""
    if len(fit.discs) < LEAST_DROPLETS:
        return ()
    share = float(np.mean(_left(shot, search, fit, VEIL) < _left(shot, search, fit, 0.0)))
    if share < max(MANY, 0.5 + CHANCE / np.sqrt(len(fit.discs))):
        return ()
    return (
        f"{100 * share:.0f} % of the droplets, limit {100 * MANY:.0f} %, look more like larger ones behind a veil of "
        f"{100 * VEIL:.0f} % of the light: is a dark image missing (the camera's black level), is there stray light, "
        "are grey values not in proportion to light (gamma), is the light on twice within an exposure, or are droplets "
        "not opaque? Diameters are too small then, and the number may be wrong",
    )


def _left(shot: Transmissions, search: DropletSearch, fit: ShadowFit, veil: float) -> FloatArray:
    """What is left around each droplet, squared, if so much of the light were a veil."""
    lighter = zip(shot.images, fit.optics.levels, strict=True)
    images = tuple(((image - np.float32(veil * level)) / np.float32(1 - veil)) for image, level in lighter)
    begun = replace(fit, discs=_deeper(shot, fit, veil), noises=fit.noises / (1 - veil))
    return ShadowRounds(replace(shot, images=images), search).left_around(begun)


def _deeper(shot: Transmissions, fit: ShadowFit, veil: float) -> Discs:
    """Discs about as large as they must be to be as dark behind a veil: where a fit begins."""
    blurs_px = fit.optics.blurs_px(fit.discs.positions_voxel[:, 2]).mean(axis=0)
    wide_voxel2 = 2 * (blurs_px / shot.lattice.pixels_per_voxel) ** 2
    depths = 1 - np.exp(-fit.discs.squares_voxel2 / wide_voxel2)
    deeper = -np.log(1 - np.minimum(depths / (1 - veil), DEEPEST)) * wide_voxel2
    return Discs(fit.discs.positions_voxel, np.where(depths < LARGE, deeper, fit.discs.squares_voxel2))
