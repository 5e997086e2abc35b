"""What speaks against an exposure of shadows: its light, what discs leave of it, shadows that are grey or not round."""

from collections.abc import Sequence

import numpy as np

from processing.analysis.droplets.droplet_search import DropletSearch
from processing.analysis.droplets.droplet_table import SizedDroplets
from processing.analysis.droplets.gaussian_blobs import Image
from processing.analysis.droplets.measured_exposure import MeasuredExposure, Seen, ShotVerdict
from processing.analysis.droplets.shadows.black_level import black_doubts
from processing.analysis.droplets.shadows.discs.opaque_discs import DiscImages, Shadows
from processing.analysis.droplets.shadows.light.fringes import fringes_of
from processing.analysis.droplets.shadows.light.seen_light import LEAST_DROPLETS, without_fringes
from processing.analysis.droplets.shadows.masked_liquid import UNEXPLAINED
from processing.analysis.droplets.shadows.shadow_fit import ShadowFit, Transmissions, rms_over_noise
from processing.analysis.droplets.verdicts.explained_images import RatioLimits, judged
from processing.geometry import FloatArray
from processing.light import unknown_light

LIMITS = RatioLimits(trusted=1.25, refused=2.0)
"""Of discs: overlapping shadows leave something even where all droplets are right. Simulated shots of 28 to 40 droplets
per mm^3, up to 1.25 have 0.3 to 1.7 % ghosts, from 1.33 to 1.45 2 to 5 %."""
COHERENT_LIMITS = RatioLimits(trusted=1.1, refused=2.0)
"""In partially coherent light fringes look like faint droplets: 0 % ghosts at 1.06, 4 % at 1.16, 18 % at 1.24."""
FRINGELESS = 1.2
"""Light of more than so many apertures of the lens makes no fringes."""
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
UNLIKE_BLURS = 1.4
"""Blur of the widest view over that of the sharpest, in light that shows: diffraction by like lenses is as wide in all.
Two of four lenses out of focus, at 1.5 and 1.8, made diameters 7 and 9 um too large, and the light another one."""


def unlit(images: Sequence[Image], trusts: Sequence[Image], names: Sequence[str]) -> tuple[str, ...]:
    """Why views can show no shadows, whether there are droplets or not; empty where all can."""
    reasons = (_without_light(*view) for view in zip(names, images, trusts, strict=True))
    return tuple(reason for reason in reasons if reason)


def _without_light(name: str, image: Image, trust: Image) -> str:
    if unknown := unknown_light(trust > 0):
        return f"{name} {unknown}"
    light = float(np.percentile(image[trust > 0], FREE_PERCENTILE))
    if LIGHTS[0] <= light <= LIGHTS[1]:
        return ""
    return (
        f"{name}: its light is {light:.2g} of its background's, limits {LIGHTS[0]:g} and {LIGHTS[1]:g}: is a lens "
        "covered, a light off, or was the background taken with another light?"
    )


def judged_by_light(
    shot: Transmissions, fit: ShadowFit, search: DropletSearch, asked: DiscImages, shadows: Shadows, ratio: float
) -> tuple[ShotVerdict, tuple[str, ...]]:
    """Verdict and reasons.

    Parameters
    ----------
    shot, fit, search : Transmissions, ShadowFit, DropletSearch
        What was recorded, what is known of it, and where droplets were looked for.
    asked : DiscImages
        What was seen, with weights of the pixels that look into the grid alone.
    shadows : Shadows
        What the discs of the fit would show.
    ratio : float
        Residual over noise, with all discs.
    """
    bare = rms_over_noise(asked, [np.ones_like(image) for image in asked.images])
    beside_px = dict(zip(search.names, np.hypot(*fit.optics.shifts_px.T).tolist(), strict=True))
    limits = COHERENT_LIMITS if (fit.optics.condenser_ratio or FRINGELESS) < FRINGELESS else LIMITS
    verdict, reasons = judged(beside_px, ratio, bare, limits)
    black = grey(asked, shadows) or black_doubts(shot, search, fit)
    unlike = _unlike_blurs(fit, search.names, 0.5 * search.searched.shape[0])
    doubts = (*black, *unlike, *_fringe_doubts(asked, shadows), *fit.light.doubts(len(fit.discs)))
    if doubts and verdict is ShotVerdict.GOOD:
        verdict = ShotVerdict.DOUBTFUL
    return verdict, (*reasons, *doubts)


def covered_share(asked: DiscImages, shadows: Shadows) -> float:
    """Share of the views that droplets cover, where they are asked."""
    views = zip(shadows.transmissions, asked.weights, strict=True)
    return float(np.mean([np.mean(1 - drawn[weight > 0]) if np.any(weight > 0) else 0.0 for drawn, weight in views]))


def grey(seen: DiscImages, shadows: Shadows) -> tuple[str, ...]:
    """What speaks against shadows that are not dark enough; empty where they are, or none is large enough to tell."""
    views = zip(seen.images, shadows.transmissions, seen.weights, strict=True)
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
        "droplets not opaque, as those that pass light in their middle? Diameters are wrong then",
    )


def _unlike_blurs(fit: ShadowFit, names: Sequence[str], z_voxel: float) -> tuple[str, ...]:
    """What speaks against one light for all views; empty where none shows, or all are about as sharp."""
    blurs_px = fit.optics.blurs_px(z_voxel)
    sharpest, widest = int(blurs_px.argmin()), int(blurs_px.argmax())
    if fit.optics.condenser_ratio is None or blurs_px[widest] <= UNLIKE_BLURS * blurs_px[sharpest]:
        return ()
    return (
        f"{names[widest]} is blurred by {blurs_px[widest]:.2f} px and {names[sharpest]} by {blurs_px[sharpest]:.2f}, "
        f"limit {UNLIKE_BLURS:g} times: is a lens out of focus, or its aperture another one? One light is taken for "
        "all views, and diameters may be 10 um wrong: focus, or measure without that view",
    )


def _fringe_doubts(seen: DiscImages, shadows: Shadows) -> tuple[str, ...]:
    """What speaks against diameters in a light whose fringes are not there; empty in a light that makes none."""
    fringes = fringes_of(seen, shadows)
    return (without_fringes(fringes, "may be 10 um too small"),) if fringes.missing else ()


def judged_by_shape(shot: MeasuredExposure[SizedDroplets, Seen]) -> MeasuredExposure[SizedDroplets, Seen]:
    """A shot, doubtful where many droplets do not look as round opaque discs do, however small they are."""
    reason = unlike_discs(shot.droplets.residual)
    return shot.doubted((reason,)) if reason else shot


def unlike_discs(residual: FloatArray) -> str:
    """Why shapes are doubted, by what is left around each of N droplets; empty where few are unlike, or N is small."""
    unlike = int(np.count_nonzero(residual > UNEXPLAINED))
    if len(residual) < LEAST_DROPLETS or unlike <= MANY_UNLIKE * len(residual):
        return ""
    share = f"{100 * unlike / len(residual):.0f} % of {len(residual)} droplets, limit {100 * MANY_UNLIKE:.0f} %"
    return (
        f"{share}, do not look like round opaque discs: do they move by more than their blur while the light is on, is "
        "the light on twice within an exposure, do they pass light in their middle, or are images processed? Number "
        "and diameters are wrong then"
    )
