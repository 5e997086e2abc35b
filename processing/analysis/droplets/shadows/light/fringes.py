"""Fringes: light from few directions makes rims around droplets that are brighter than the light by up to a fiftieth.

Nothing else does. Droplets that move, and lenses out of focus, look much like such light, but make none; and droplets
in light of 0.8 apertures look much like larger ones behind a Gaussian blur, but for their fringes.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from processing.analysis.droplets.shadows.discs.opaque_discs import DiscImages, Shadows

FREE, BRIGHTER = 0.0005, 0.001
"""Light beyond 1 that counts as none, and as a fringe's."""
LEAST_FRINGES = 0.5
"""Of those that a light makes. In simulated light of 0.3 to 0.83 apertures 0.8 to 1.15 of them are there; none (-0.1 to
0.2) behind a Gaussian blur, where droplets move, or where lenses are out of focus."""
SURE = 3.0
"""Standard deviations by which there are fringes, or fewer than that."""


@dataclass(frozen=True)
class Fringes:
    """Of the fringes that a light would make.

    Parameters
    ----------
    share : float
        That is in the images.
    sd : float
        Its standard deviation by noise; infinite where the light would make none.
    """

    share: float = 0.0
    sd: float = np.inf

    @property
    def seen(self) -> bool:
        """Whether they are there for sure."""
        return self.share > max(LEAST_FRINGES, SURE * self.sd)

    @property
    def missing(self) -> bool:
        """Whether most of them are not there for sure."""
        return self.share + SURE * self.sd < LEAST_FRINGES


def fringes_of(seen: DiscImages, shadows: Shadows) -> Fringes:
    """How much of the fringes of discs in some light is in the images, beyond the light beside them.

    Parameters
    ----------
    seen : DiscImages
        The images, with weights of their pixels.
    shadows : Shadows
        Of the discs.
    """
    share, weight = 0.0, 0.0
    for image, drawn, known in zip(seen.images, shadows.transmissions, seen.weights, strict=True):
        fringes, free = (drawn > 1 + BRIGHTER) & (known > 0), (np.abs(drawn - 1) < FREE) & (known > 0)
        if fringes.any() and free.any():
            weighed = (drawn[fringes] - 1) * known[fringes]
            share += float(weighed @ (image[fringes] - np.mean(image[free])))
            weight += float(weighed @ (drawn[fringes] - 1))
    return Fringes(share / weight, float(1 / np.sqrt(weight))) if weight else Fringes()


def together(several: Iterable[Fringes | None]) -> Fringes:
    """Fringes of several exposures as those of one: what is surer has more say, and none where nobody asked."""
    known = [one for one in several if one is not None and np.isfinite(one.sd)]
    weights = [one.sd**-2 for one in known]
    if not known:
        return Fringes()
    share = sum(one.share * weight for one, weight in zip(known, weights, strict=True)) / sum(weights)
    return Fringes(share, float(sum(weights) ** -0.5))
