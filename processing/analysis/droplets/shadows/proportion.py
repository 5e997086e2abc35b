"""Are grey values in proportion to light? A gamma, as of sRGB, moves edges, and makes them fall off otherwise.

Droplets and blur that are fitted to such images are smaller or larger, and explain them to the noise. But not quite:
they are fitted anew to several powers of the images, and the one is told that explains the images, as recorded, best.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_search import DropletSearch
from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.shadows.black_level import PALE, depths
from processing.analysis.droplets.shadows.discs.opaque_discs import DiscImages
from processing.analysis.droplets.shadows.least_left import LeastLeft, least_left
from processing.analysis.droplets.shadows.light.seen_light import LEAST_DROPLETS
from processing.analysis.droplets.shadows.shadow_fit import ShadowFit, Transmissions, seen_by
from processing.analysis.droplets.shadows.shadow_rounds import ShadowRounds
from processing.geometry import FloatArray

STEP = 1.4
"""From one power that is tried to the next."""
MOST_STEPS = 2
LIMIT, SURE = 0.45, 2.0
"""Steps from proportion, beyond so many standard deviations. Of simulated shots in any light -0.21 to 0.14 is told
where the power is 1, and -0.36 where a tenth of many droplets are ghosts; 0.4 to 0.6 where images have a gamma of 0.7,
1.0 to 1.2 where they have that of sRGB."""
WRONG_BY = 20.0
"""Percent of the diameters per step; glare around shadows, as of a tenth of the light, looks like one, and costs 2."""
RESOLVED, FEWEST_RESOLVED = 0.6, 2
"""Share of the light that a droplet takes at its centre which is 1.35 times as wide as its blur, and how many such ones
there must be. Where all are smaller, as 35 droplets of 24 or 30 um behind a blur of 0.8 px, blur and diameters explain
what powers above 1 do, and steps of 0.4 to 2 were told where the power is 1."""
FEWEST_VIEWS = 3
"""Two views hardly tell blur from diameters."""


def proportion_doubts(shot: Transmissions, search: DropletSearch, fit: ShadowFit) -> tuple[str, ...]:
    """What droplets say against grey values in proportion to light; empty where too few say anything.

    Nor do edges behind a blur narrower than pixels: how these fall off is the pixels' doing.
    """
    taken = depths(shot, fit)
    asked, wide = taken > PALE, np.count_nonzero(taken > RESOLVED)
    resolved = wide >= FEWEST_RESOLVED and ShadowRounds(shot, search).resolves_light(fit)
    if np.count_nonzero(asked) < LEAST_DROPLETS or len(shot.images) < FEWEST_VIEWS or not resolved:
        return ()
    found = least_left(lambda step: _left(shot, search, fit, STEP**step)[asked], -MOST_STEPS, MOST_STEPS)
    return _told(found)


def _told(found: LeastLeft) -> tuple[str, ...]:
    if abs(found.step) <= LIMIT + SURE * found.sd:
        return ()
    wrong = "small" if found.step > 0 else "large"
    return (
        f"droplets explain the images better by their power of {STEP**found.step:.2g} than by grey values in "
        "proportion to light: do images have a gamma, as sRGB has, were they processed, or is there glare around "
        f"shadows? Diameters are too {wrong} then, by up to {WRONG_BY * abs(found.step):.0f} %; record with gamma 1, "
        "or undo it before the import",
    )


def _left(shot: Transmissions, search: DropletSearch, fit: ShadowFit, power: float) -> FloatArray:
    """What is left of the images as recorded around each droplet, squared, if the light were a power of them."""
    levels = fit.optics.levels.astype(np.float32)
    lit = zip(shot.images, levels, strict=True)
    images = tuple(np.asarray(level * _power(image / level, power), np.float32) for image, level in lit)
    rounds = ShadowRounds(replace(shot, images=images), search)
    fitted = rounds.settled(replace(fit, noises=fit.noises * power))
    shadows = rounds.shadows(fitted)
    told = _recorded(shadows.transmissions, fitted, levels, power)
    seen = seen_by(shot, replace(fit, defects=()), told)
    left = (drawn + image - one for drawn, image, one in zip(shadows.transmissions, seen.images, told, strict=True))
    asked = DiscImages(tuple(left), seen.weights, shot.lattice, shot.threads)
    return np.asarray(asked.supports(shadows, fitted.optics, fitted.discs).residual ** 2)


def _recorded(drawn: list[Image], fitted: ShadowFit, levels: NDArray[np.float32], power: float) -> list[Image]:
    """What images would have recorded of the shadows that explain their power, over their levels."""
    defects = fitted.defects or tuple(map(np.zeros_like, drawn))
    lit = zip(drawn, defects, fitted.optics.levels / levels, strict=True)
    return [_power(np.float32(level) * np.maximum(image + defect, 0), 1 / power) for image, defect, level in lit]


def _power(image: Image, power: float) -> Image:
    """Noise below black stays below it."""
    return np.asarray(np.sign(image) * np.abs(image) ** np.float32(power), np.float32)
