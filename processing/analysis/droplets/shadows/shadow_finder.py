"""Droplets of shadow images, found by what the fit has left over, without any truth.

Coarse to fine, large discs first: where all views miss light that the discs let through, a candidate enters without
size and shares the shadow with the others; those that stay insignificant are dropped; the threshold falls. Blur, level
and a shift of each image are re-estimated meanwhile, and what the product of shadows gets wrong about the very discs is
taken off the images. A view that sees black has no say.

Ghosts live on shadows that the views share out among too many droplets. When the threshold has fallen, all droplets are
dropped that some view disputes, and found anew; now also such as one view cannot see beside a larger one, if three
views support them alone. Ghosts do not come back; so it goes on until no more droplets are beyond dispute, and the fit
comes to rest.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from processing.analysis.droplets.droplet_search import DropletSearch, keep_on
from processing.analysis.droplets.shadows.discs.disc_optics import first_disc_optics
from processing.analysis.droplets.shadows.discs.opaque_discs import Discs
from processing.analysis.droplets.shadows.light.light_search import Light, larger_than_stated, seen_light, stated_ratio
from processing.analysis.droplets.shadows.light.seen_light import LEAST_DROPLETS, SeenLight, looks_otherwise
from processing.analysis.droplets.shadows.shadow_candidates import Stage
from processing.analysis.droplets.shadows.shadow_fit import ShadowFit, Transmissions
from processing.analysis.droplets.shadows.shadow_rounds import ShadowRounds
from processing.geometry import FloatArray

COARSE_PX = (6.0, 4.0, 2.5, 1.5, 0.9)
"""Blurs with which candidates are looked for, at first."""
COARSE_SHARE = 0.5
FIRST, AGAIN = 0.5, 0.2
"""Missing share of the light from which on a candidate is tried: at first, and after a purge."""
FALLING_ROUNDS, AGAIN_ROUNDS = 8, 3
"""In which it falls; after a purge."""
COHERENT_SHARE = 0.02
"""Of a diameter: what is wrong in any light that shows, common to the droplets of a shot."""
CONTRADICTED = 2.0
"""Standard deviations by which diameters differ from those in the light that shows: by such a share of them, and by
what the light is not known to."""
FEWEST_AGAINST = 4
"""Droplets that can contradict a light: so few must all do so."""
PURGES, SETTLED = 6, 0.003
"""So often at most disputed droplets are dropped and found anew; it ends when the others stay as many, about."""


def nobody_knows() -> SeenLight | None:
    """Nobody but the droplets of an exposure says which light it is in."""


def find_shadows(
    shot: Transmissions,
    search: DropletSearch,
    light: Light = "estimated",
    before_round: Callable[[], None] = keep_on,
    known_light: Callable[[], SeenLight | None] = nobody_knows,
) -> ShadowFit:
    """Find the droplets of one exposure.

    Parameters
    ----------
    shot : Transmissions
        Images with the lattice of the search.
    search : DropletSearch
        Where to look: it must hold every droplet that the views show.
    light : float | "estimated" | "incoherent" | "gaussian"
        Numerical aperture of the light over that of the lens; estimated from the droplets that are found behind a
        Gaussian blur; where another light explains them better, the search goes on in that.
    before_round : callable
        Called before each round; what it raises ends the search.
    known_light : callable
        Asked for a light that is to be estimated where droplets are too few to vote: what those of other shots say.
    """
    if light != "estimated":
        return _found(shot, search, stated_ratio(light), before_round)
    fit = _found(shot, search, None, before_round)
    finder = ShadowRounds(shot, search, before_round)
    few = 0 < len(fit.discs) < LEAST_DROPLETS
    seen = (known_light() if few else None) or finder.light(fit)
    if seen.condenser_ratio is not None:
        fit = _purged(finder, finder.relit(fit, seen.condenser_ratio))
    return replace(fit, light=seen)


def light_contradicted(
    shot: Transmissions, search: DropletSearch, fit: ShadowFit, light: Light, before_round: Callable[[], None]
) -> tuple[str, ...]:
    """What speaks against a light that was stated, or told by other shots: droplets that surely tell another one.

    Of one that these droplets told themselves nothing is said, nor where diameters hardly differ.
    """
    if len(fit.discs) < FEWEST_AGAINST or (light == "estimated" and len(fit.discs) >= LEAST_DROPLETS):
        return ()
    finder = ShadowRounds(shot, search, before_round)
    in_light, stated = cache(lambda ratio: finder.in_light(fit, ratio)), fit.optics.condenser_ratio
    seen = seen_light(in_light, resolved=finder.resolves_light(fit), fewest=FEWEST_AGAINST)
    if seen.doubts(max(len(fit.discs), LEAST_DROPLETS)):
        return ()
    larger = larger_than_stated(in_light, stated, seen.condenser_ratio)
    known_voxel = np.hypot(COHERENT_SHARE * np.median(fit.discs.radii_voxel), fit.light.radius_sd)
    if abs(larger) <= CONTRADICTED * known_voxel:
        return ()
    off_um = 2000 * larger * search.searched.pitch_mm
    return (looks_otherwise(stated, seen.condenser_ratio, off_um, by_others=light == "estimated"),)


def behind_gaussian_blur(shot: Transmissions, search: DropletSearch, fit: ShadowFit) -> FloatArray:
    """Squared radii (N,) that the droplets would have if a Gaussian blur were all that is seen of the light."""
    if fit.optics.condenser_ratio is None or not len(fit.discs):
        return fit.discs.squares_voxel2
    return ShadowRounds(shot, search).relit(fit, None).discs.squares_voxel2


def _found(
    shot: Transmissions, search: DropletSearch, condenser_ratio: float | None, before_round: Callable[[], None]
) -> ShadowFit:
    """The droplets in one light, from the beginning."""
    optics = replace(first_disc_optics(shot.images), condenser_ratio=condenser_ratio)
    fit = ShadowFit(Discs.none(), optics, shot.noises_of(shot.images))
    finder = ShadowRounds(shot, search, before_round)
    for number, smooth_px in enumerate(COARSE_PX):
        fit = finder.round(fit, Stage(smooth_px, COARSE_SHARE, coarse=True), estimate=number > 0)
    return _purged(finder, finder.fallen(fit, FIRST, FALLING_ROUNDS, joker=False))


def _purged(finder: ShadowRounds, fit: ShadowFit) -> ShadowFit:
    """Without disputed droplets, which are found anew, until no more droplets are beyond dispute; and at rest."""
    fit, known = finder.undisputed(fit), 0
    for _ in range(PURGES):
        if abs(len(fit.discs) - known) <= SETTLED * known:
            break
        known = len(fit.discs)
        fit = finder.undisputed(finder.fallen(fit, AGAIN, AGAIN_ROUNDS, joker=True))
    return finder.finished(finder.rested(finder.fallen(fit, AGAIN, AGAIN_ROUNDS, joker=True)))
