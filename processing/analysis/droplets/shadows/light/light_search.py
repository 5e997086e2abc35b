"""Which light explains an exposure best: from all directions, from as few as a condenser lets through, or any, blurred.

A lens that is sharp shows diffraction, and how that looks depends on how many directions light comes from: on the
aperture of the light over that of the lens. Of a lens that is not, a Gaussian blur is all that is seen.

Droplets vote. What is left of the images as a whole is left by ligaments and by droplets that overlap, whatever the
light; of most droplets only the light decides how well they are explained. Lights from 1.3 apertures up to all
directions look alike, and diameters differ by 7 um: of lights that explain droplets equally well the middle one is
taken, and how far radii differ among them is told.

Three things look alike but for the fringes: droplets in light of 0.8 apertures, larger ones behind a Gaussian blur, and
such that move. So the light that explains droplets best is believed only if the images show the fringes that it, or
one that explains them as well, would make.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Literal, TypeVar

import numpy as np
from pydantic import Field

from processing.analysis.droplets.shadows.light.fringes import LEAST_FRINGES, Fringes
from processing.analysis.droplets.shadows.light.seen_light import LEAST_DROPLETS, SURE, UNSURE, SeenLight
from processing.coherent_light import MOST_RATIO
from processing.geometry import FloatArray

NamedLight = Literal["estimated", "incoherent", "gaussian"]
Light = Annotated[float, Field(gt=0, le=MOST_RATIO)] | NamedLight
"""The aperture of the light over that of the lens; from all directions; whatever is behind a Gaussian blur; or
whichever of them explains the images best."""
Ratio = TypeVar("Ratio", float, float | None)
CONDENSER_RATIOS = (MOST_RATIO, 3.0, 1.8, 1.3, 1.15, 1.0, 0.9, 0.85, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2)
"""That are tried, from the least to the most coherent."""
FIRST_TRIED = (MOST_RATIO, 1.15, 0.85, 0.8, 0.7)
"""One of them is better than a Gaussian blur wherever any is."""
FLAT = 1.0
"""From here on what is left changes little with the light, and may have two valleys: all of them are tried."""
FRINGED = 0.83
"""Up to this ratio a light makes fringes that can be seen."""
LEAST_BLUR_PX = 0.6
"""Of views in the mean: pixels that are wider leave edges by which a Gaussian blur looks like light."""
ALIKE, ALIKE_SD = 0.02, 2.0
"""Lights leave alike where logarithms of what they leave differ by less than such a share of what the best one gains
over a Gaussian blur, in the mean of the droplets: theory and lenses differ by as much. Or, where they gain little, of
what noise leaves: droplets of one size look nearly alike in all lights. Or by less than so many standard deviations of
that mean."""
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
    fringes : Fringes | None
        How much of the fringes of that light the images show; None: nobody asked.
    """

    squares: FloatArray
    radii: FloatArray
    fringes: Fringes | None = None


def seen_light(
    relit: Callable[[float | None], Relit], *, resolved: bool = True, fewest: int = LEAST_DROPLETS
) -> SeenLight:
    """The light that explains most droplets best.

    Parameters
    ----------
    relit : callable
        Of a condenser ratio, or None for a Gaussian blur: the droplets in that light.
    resolved : bool
        Whether pixels are fine enough to tell without fringes; else droplets can only be unsure of such light.
    fewest : int
        Of fewer droplets nothing is told.
    """
    blurred = relit(None)
    if len(blurred.squares) < fewest:
        return SeenLight()
    tried = {ratio: relit(ratio) for ratio in FIRST_TRIED}
    if _is_blur(tried, blurred):
        return SeenLight(None, _share(tried[_best(tried)], blurred))
    while unknown := [ratio for ratio in _next_ratios(tried) if ratio not in tried]:
        tried |= {ratio: relit(ratio) for ratio in unknown}
    best, alike = tried[_best(tried)], _alike(tried, blurred)
    fringes = _asked(alike)
    share, other_sd = _share(best, blurred), abs(float(np.median(best.radii - blurred.radii))) / np.sqrt(3)
    if fringes is not None and not fringes.seen and resolved:
        return SeenLight(None, share, other_sd, fringes)
    if not (fringes and fringes.seen) and not (resolved and _is_sure(best, blurred)):
        return SeenLight(None, min(share, 0.5 * (UNSURE + SURE)), other_sd)
    ratio, radius_sd = _middle(tried, alike)
    return SeenLight(ratio, _share(tried[ratio], blurred), radius_sd, fringes)


def larger_than_stated(relit: Callable[[float | None], Relit], stated: float | None, seen: float | None) -> float:
    """How much larger radii are in the light that is seen than in one that was stated; 0 where that fits alike."""
    two = {ratio: relit(ratio) for ratio in (seen, stated)}
    blurred = two.get(None) or relit(None)
    return 0.0 if stated in _alike(two, blurred) else float(np.median(two[seen].radii - two[stated].radii))


def _share(relit: Relit, blurred: Relit) -> float:
    """Of the droplets, which a light explains better than a Gaussian blur."""
    return float(np.mean(relit.squares < blurred.squares))


def _is_blur(tried: Mapping[float, Relit], blurred: Relit) -> bool:
    """Whether a Gaussian blur is better for sure, and the images do not rather show the fringes of the next best."""
    best = _best(tried)
    worse = _share(tried[best], blurred) <= UNSURE and not _fit_alike(blurred, tried[best])
    fringes = _asked({best: tried[best]})
    return worse and (fringes is None or fringes.share <= LEAST_FRINGES)


def _is_sure(best: Relit, blurred: Relit) -> bool:
    """Whether most droplets speak for a light, by votes or by what it leaves more than by chance."""
    share = _share(best, blurred)
    return share >= SURE and bool(share >= 0.5 + 1 / np.sqrt(len(best.squares)) or not _fit_alike(best, blurred))


def _fit_alike(better: Relit, other: Relit, floor: float = 0.0) -> bool:
    """Whether another light leaves no more than one that leaves less, as far as that can be told."""
    more = _logs(other) - _logs(better)
    return bool(more.mean() < max(floor, ALIKE_SD * more.std() / np.sqrt(len(more))))


def _alike(tried: Mapping[Ratio, Relit], blurred: Relit) -> dict[Ratio, Relit]:
    """The lights that leave as little as the best one, as far as that can be told; that one among them."""
    best = tried[_best(tried)]
    floor = ALIKE * max(1.0, float(np.mean(_logs(blurred) - _logs(best))))
    return {ratio: one for ratio, one in tried.items() if one is best or _fit_alike(best, one, floor)}


def _asked(alike: Mapping[float, Relit]) -> Fringes | None:
    """Fringes of the best one of such lights that make some; None where they make none."""
    fringed = {ratio: one for ratio, one in alike.items() if ratio <= FRINGED}
    return fringed[_best(fringed)].fringes if fringed else None


def _logs(relit: Relit) -> FloatArray:
    """Logarithms (N,) of what is left: droplets that nothing explains have no more say than others."""
    return np.log(np.maximum(relit.squares, 1e-12))


def _left(tried: Mapping[Ratio, Relit]) -> FloatArray:
    """Of all lights (lights, N)."""
    return np.array([_logs(one) for one in tried.values()])


def _best(tried: Mapping[Ratio, Relit]) -> Ratio:
    return list(tried)[int(_left(tried).mean(axis=1).argmin())]


def _middle(tried: Mapping[float, Relit], alike: Mapping[float, Relit]) -> tuple[float, float]:
    """The middle one of the lights that leave alike, and the standard deviation of radii among them.

    Radii may be anywhere between those in these lights; and other draws of the same droplets would have found other
    lights best.
    """
    left, ratios, best = _left(tried), list(tried), tried[_best(tried)]
    draws = np.random.default_rng(0).integers(0, left.shape[1], (DRAWS, left.shape[1]))
    chosen = left[:, draws].mean(axis=2).argmin(axis=0)
    larger = np.array([np.median(one.radii - best.radii) for one in tried.values()])
    among = larger[[ratio in alike for ratio in ratios]]
    middle, half = 0.5 * (among.min() + among.max()), 0.5 * np.ptp(among)
    taken = int(np.lexsort((left.mean(axis=1), np.abs(larger - middle)))[0])
    by_draws = np.sqrt(np.mean((larger[chosen] - larger[taken]) ** 2))
    return ratios[taken], float(max(by_draws, np.hypot(half / np.sqrt(3), middle - larger[taken])))


def _next_ratios(tried: Mapping[float, Relit]) -> list[float]:
    """Neighbours of the best ratio, and all flat ones if it is one; then the vertex of the parabola through three."""
    best = _best(tried)
    if best not in CONDENSER_RATIOS:
        return []
    number = CONDENSER_RATIOS.index(best)
    around = CONDENSER_RATIOS[max(number - 1, 0) : number + 2]
    flat = [ratio for ratio in CONDENSER_RATIOS if ratio >= FLAT] if best >= FLAT else []
    unknown = [ratio for ratio in dict.fromkeys((*flat, *around)) if ratio not in tried]
    if unknown or len(around) < 3:
        return unknown
    left = _left({ratio: tried[ratio] for ratio in around}).mean(axis=1)
    bend, slope, _ = np.polyfit([1 / ratio for ratio in around], left, 2)
    return [float(f"{-2 * bend / slope:.2g}")]
