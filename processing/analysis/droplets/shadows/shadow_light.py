"""Whether the light of a shot is that of its background, and shadows are black and round."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from processing.analysis.droplets.droplet_table import SizedDroplets
from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.measured_exposure import MeasuredExposure, Seen, ShotVerdict
from processing.analysis.droplets.shadows.light_search import LEAST_DROPLETS
from processing.analysis.droplets.shadows.masked_liquid import UNEXPLAINED
from processing.analysis.droplets.shadows.opaque_discs import DiscImages, Shadows

LIGHTS = (0.5, 2.0)
"""Of the background: where nearly nothing is in its way, the light of an exposure must be between."""
FREE_PERCENTILE = 98
BLACK, BLACK_PIXELS = 0.2, 10
"""Where discs let less light through than this, images are asked how much they see beyond that, at so many pixels."""
MOST_LEFT = 0.04
"""Share of the light that may be left there: diameters are 3 % too small then, and with twice as much ghosts come."""
MANY_UNLIKE = 1 / 8
"""Of the droplets, around which more is left than round opaque discs leave. Simulated shots of up to 28 per mm^3 have 0
to 10 %, 19 to 75 % where droplets move by two pixels or more while light is on, or are there twice."""
LEAST_KNOWN = 0.1
"""Share of the pixels of a view of which something must be known."""


def unlit(images: Sequence[Image], trusts: Sequence[Image], names: Sequence[str]) -> tuple[str, ...]:
    """Why views can show no shadows, whether there are droplets or not; empty where all can."""
    reasons = (_without_light(*view) for view in zip(names, images, trusts, strict=True))
    return tuple(reason for reason in reasons if reason)


def _without_light(name: str, image: Image, trust: Image) -> str:
    known = image[trust > 0]
    if known.size < LEAST_KNOWN * image.size:
        return f"{name}: {known.size / image.size:.0%} of its pixels are known: is its background saturated, or dark?"
    light = float(np.percentile(known, FREE_PERCENTILE))
    if LIGHTS[0] <= light <= LIGHTS[1]:
        return ""
    return (
        f"{name}: its light is {light:.2g} of its background's, limits {LIGHTS[0]:g} and {LIGHTS[1]:g}: is a lens "
        "covered, a light off, or was the background taken with another light?"
    )


def grey(seen: DiscImages, shadows: Shadows, weights: Sequence[Image]) -> tuple[str, ...]:
    """What speaks against shadows that are not dark enough; empty where they are, or none is large enough to tell."""
    views = zip(seen.images, shadows.transmissions, weights, strict=True)
    asked = [(image - drawn, weight, (drawn < BLACK) & (weight > 0)) for image, drawn, weight in views]
    left = np.concatenate([beyond[black] for beyond, _, black in asked])
    if len(left) < BLACK_PIXELS:
        return ()
    sd = 1 / np.sqrt(sum(float(weight[black].sum()) for _, weight, black in asked))
    if (share := float(np.median(left))) <= MOST_LEFT + 3 * sd:
        return ()
    return (
        f"{100 * share:.0f} % of the light is left where shadows should be black, limit {100 * MOST_LEFT:.0f} %: is a "
        "dark image missing (the camera's black level), are grey values not in proportion to light (gamma), or are "
        "droplets not opaque? Diameters are wrong then",
    )


def judged_by_shape(shot: MeasuredExposure[SizedDroplets, Seen]) -> MeasuredExposure[SizedDroplets, Seen]:
    """A shot, doubtful where many droplets do not look as round opaque discs do, however small they are."""
    unlike = int(np.count_nonzero(shot.droplets.residual > UNEXPLAINED))
    if len(shot.droplets) < LEAST_DROPLETS or unlike <= MANY_UNLIKE * len(shot.droplets):
        return shot
    share = f"{100 * unlike / len(shot.droplets):.0f} % of the droplets, limit {100 * MANY_UNLIKE:.0f} %"
    reason = (
        f"{share}, do not look like round opaque discs: do they move by more than their blur while the light is on, is "
        "the light on twice within an exposure, or are images processed? Number and diameters are wrong then"
    )
    verdict = ShotVerdict.DOUBTFUL if shot.verdict is ShotVerdict.GOOD else shot.verdict
    return replace(shot, verdict=verdict, reasons=(*shot.reasons, reason))
