"""Sizes of many droplets: mean diameters, quantiles by volume, classes, number density, each with its interval.

Mean diameters after ISO 9276-2 and ASTM E799: ``D_pq = (sum d^p / sum d^q)^(1 / (p - q))``. Intervals hold 95 %. Those
of diameters come from ``processing.analysis.estimates``: shots are drawn with replacement where there are several,
droplets where there is one. Droplets of one shot belong together: who draws droplets learns nothing of how shots
differ.

Nor does a bootstrap know of droplets larger than all that were seen, which carry volume: D43 is widened
(``unseen_tail``), and a quantile by volume with few droplets beyond it is not told.
"""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field
from scipy.special import chdtri

from processing.analysis.estimates import (
    CONFIDENCE,
    COUNTED_DRAWS,
    DRAWS,
    FEW_SHOTS,
    Estimate,
    estimated,
    weighted_quantiles,
)
from processing.analysis.unseen_tail import de_brouckere_off, drawn_sprays, with_unseen
from processing.geometry import FloatArray
from processing.masked import require_unmasked
from processing.reconstruction.settings import FrozenValue

SPAN, D43 = "relative_span", "d43_um"
ORDERS = ((1, 0), (2, 0), (3, 0), (3, 2), (4, 3))
QUANTILES = (0.1, 0.5, 0.9)
BY_VOLUME = tuple(f"dv{round(100 * share)}_um" for share in QUANTILES)
CLASSES_PER_DECADE = 20
"""Classes of diameters grow by 12 %: the preferred numbers R20 of ISO 3, geometric as ISO 9276-1 has them."""
FEWEST = 5
"""Droplets of a mean, and those larger than a quantile by volume, and those smaller. Of 5 to 40 droplets of lognormal
sprays with spreads of 0.2 to 0.6, intervals of dv90 would hold the truth in 46 %, of 80 to 320 in 71 %; those that are
told hold it in 89 %."""
NOTHING_MEASURED = "no droplet was measured"
TOO_FEW = f"too few droplets: means need {FEWEST}, a quantile by volume {FEWEST} larger and {FEWEST} smaller ones"
_TAIL = (1 - CONFIDENCE) / 2


class SizeStatistics(FrozenValue):
    """Diameters of a spray; where one is missing, ``reason`` says why."""

    n: Annotated[int, Field(description="droplets in all exposures: A and B show the same ones, and both count")]
    shots: Annotated[int, Field(description="shots that they come from")]
    d10_um: Annotated[Estimate | None, Field(description="mean diameter")] = None
    d20_um: Annotated[Estimate | None, Field(description="of the mean surface")] = None
    d30_um: Annotated[Estimate | None, Field(description="of the mean volume")] = None
    d32_um: Annotated[Estimate | None, Field(description="Sauter's: volume over surface")] = None
    d43_um: Annotated[Estimate | None, Field(description="mean by volume, De Brouckere's")] = None
    dv10_um: Annotated[Estimate | None, Field(description="a tenth of the volume is in smaller droplets")] = None
    dv50_um: Annotated[Estimate | None, Field(description="half of the volume is in smaller droplets")] = None
    dv90_um: Annotated[Estimate | None, Field(description="nine tenths of the volume are in smaller droplets")] = None
    relative_span: Annotated[Estimate | None, Field(description="(dv90 - dv10) / dv50")] = None
    intervals_over: Annotated[
        Literal["shots", "droplets"] | None, Field(description="what the bootstrap draws; droplets: of one shot only")
    ] = None
    light_sd_um: Annotated[
        float, Field(description="that all diameters share as the light is not known better; intervals hold it")
    ] = 0.0
    reason: Annotated[str | None, Field(description="why there are no diameters; null where there are")] = None


class SizeClass(FrozenValue):
    """Droplets of one class of diameters, after ISO 9276-1."""

    low_um: Annotated[float, Field(description="smallest diameter, which belongs to the class")]
    high_um: Annotated[float, Field(description="largest diameter, which belongs to the next class")]
    n: Annotated[int, Field(description="droplets")]
    q0_per_um: Annotated[Estimate, Field(description="density by number; its interval by counting alone")]
    q2_per_um: Annotated[float, Field(description="density by area")]
    q3_per_um: Annotated[float, Field(description="density by volume")]
    cumulative_q0: Annotated[float, Field(description="share by number of droplets below high_um")]
    cumulative_q2: Annotated[float, Field(description="share by area of droplets below high_um")]
    cumulative_q3: Annotated[float, Field(description="share by volume of droplets below high_um")]


def mean_diameters(
    diameters_um_by_shot: Iterable[ArrayLike],
    exposures_per_shot: float = 1,
    confidence: float = CONFIDENCE,
    weights_by_shot: Iterable[ArrayLike] | None = None,
) -> SizeStatistics:
    """Mean diameters, quantiles by volume and relative span, with intervals.

    Parameters
    ----------
    diameters_um_by_shot : iterable of (N,) arrays
        Diameters of the droplets of every shot.
    exposures_per_shot : float
        2 where exposures A and B, which show the same droplets, are both in the array of a shot.
    confidence : float
        Of the intervals.
    weights_by_shot : iterable of (N,) arrays, optional
        For how many droplets each one stands; by default for itself.

    Raises
    ------
    ValueError
        A diameter or a weight is not finite and above 0, or there are diameters where shots should be.
    """
    by_shot = tuple(diameters_um_by_shot)
    weights = [np.ones(np.shape(one)) for one in by_shot] if weights_by_shot is None else list(weights_by_shot)
    if any(np.ndim(diameters_um) != 1 for diameters_um in by_shot):
        raise ValueError("diameters by shot, please: a list of arrays; of a single shot [diameters_um]")
    checked = (_sorted(*one) for one in zip(by_shot, weights, strict=True))
    shots = sorted((shot for shot in checked if len(shot)), key=np.ndarray.tolist)  # draws depend on no order
    weighted = np.concatenate([np.empty((0, 2)), *shots])
    diameters_um = weighted[:, 0]
    if len(diameters_um) < FEWEST * exposures_per_shot:
        reason = TOO_FEW if len(diameters_um) else NOTHING_MEASURED
        return SizeStatistics(n=len(diameters_um), shots=len(shots), reason=reason)
    several = len(shots) > 1
    units = np.repeat(np.arange(len(shots)), [len(shot) for shot in shots]) if several else np.arange(len(diameters_um))
    order = np.argsort(diameters_um, kind="stable")
    own = float(np.sqrt(exposures_per_shot))
    estimates = _estimates(weighted[order], units[order], 1.0 if several else own, confidence)
    if several and len(shots) < FEW_SHOTS:
        counted = _estimates(weighted[order], np.arange(len(order)), own, confidence, COUNTED_DRAWS)
        counted.pop(SPAN, None)  # of a span, intervals that are narrower than that hold the truth in 81 to 88 % of 90 %
        estimates = {name: one.no_surer_than(counted.get(name)) for name, one in estimates.items()}
    if (sprays := drawn_sprays(diameters_um, exposures_per_shot)) and D43 in estimates:
        estimates[D43] = with_unseen(estimates[D43], de_brouckere_off(sprays), confidence)
    known = _known(estimates, diameters_um[order], FEWEST * exposures_per_shot)
    told = {"n": len(diameters_um), "shots": len(shots), "intervals_over": "shots" if several else "droplets"}
    missing = None if known.keys() == estimates.keys() else TOO_FEW
    return SizeStatistics.model_validate({**told, "reason": missing, **known})


def shots_density(counts: ArrayLike, volumes_mm3: ArrayLike, exposures_per_shot: float = 1) -> Estimate:
    """Droplets per mm3, with an interval over shots, which is nowhere narrower than that by counting alone.

    Parameters
    ----------
    counts, volumes_mm3 : (S,) arrays
        Droplets of each shot, in all its exposures, and the volume of all its exposures together.
    exposures_per_shot : float
        As of ``number_density``.
    """
    droplets, measured_mm3 = np.asarray(counts, np.float64), np.asarray(volumes_mm3, np.float64)
    counted = number_density(int(droplets.sum()), float(measured_mm3.sum()), exposures_per_shot)

    def density(taken: FloatArray) -> FloatArray:
        with np.errstate(invalid="ignore"):  # of draws of shots that are hidden as a whole there is none
            return (taken @ droplets / (taken @ measured_mm3))[:, None]

    (over_shots,) = estimated(density, len(droplets), 1, signed=True)
    if over_shots is None:
        return counted
    return Estimate(
        value=counted.value, low=max(min(counted.low, over_shots.low), 0.0), high=max(counted.high, over_shots.high)
    )


def number_density(n: int, volume_mm3: float, exposures_per_shot: float = 1) -> Estimate:
    """Droplets per mm3, with an interval by counting alone (Garwood); shots of a spray scatter more.

    Parameters
    ----------
    n : int
        Droplets in all exposures.
    volume_mm3 : float
        Volume of all exposures together.
    exposures_per_shot : float
        Exposures A and B show the same droplets: counted twice, they are no surer.
    """
    low, high = garwood(n / exposures_per_shot)
    own_mm3 = volume_mm3 / exposures_per_shot
    return Estimate(value=n / volume_mm3, low=low / own_mm3, high=high / own_mm3)


def garwood(count: float) -> tuple[float, float]:
    """Where the mean of a Poisson distribution lies that gave this count (Garwood 1936)."""
    low = chdtri(2 * count, 1 - _TAIL) / 2 if count else 0.0
    return float(low), float(chdtri(2 * count + 2, _TAIL) / 2)


def size_classes(diameters_um: ArrayLike, exposures_per_shot: float = 1) -> tuple[SizeClass, ...]:
    """Diameters by geometric classes, 20 per decade; from the smallest droplet's to the largest one's.

    Parameters
    ----------
    diameters_um : (N,) array
        Diameters of droplets.
    exposures_per_shot : float
        As of ``mean_diameters``.

    Raises
    ------
    ValueError
        A diameter is not finite and above 0.
    """
    diameters = np.sort(_checked(diameters_um))
    if not len(diameters):
        return ()
    edges_um = _edges_um(diameters[0], diameters[-1])
    bounds = np.searchsorted(diameters, edges_um)
    shares = [np.concatenate([[0.0], np.cumsum(diameters**p)]) / np.sum(diameters**p) for p in (2, 3)]
    return tuple(
        _size_class((low_um, high_um), (first, last), shares, exposures_per_shot)
        for (low_um, high_um), (first, last) in zip(pairwise(edges_um.tolist()), pairwise(bounds.tolist()), strict=True)
    )


def class_numbers(diameters_um: ArrayLike) -> NDArray[np.intp]:
    """Of which class diameters are, (N,): number k begins at 10 ** (k / 20) um."""
    return np.floor(CLASSES_PER_DECADE * np.log10(_checked(diameters_um)) + 1e-9).astype(np.intp)


def _sorted(diameters_um: ArrayLike, weights: ArrayLike) -> FloatArray:
    """Diameters and weights, (N, 2), the smallest first."""
    rows = np.column_stack([_checked(diameters_um), _checked(weights)])
    return np.asarray(rows[np.lexsort(rows.T[::-1])])


def _checked(diameters_um: ArrayLike) -> FloatArray:
    require_unmasked("diameters", diameters_um)
    array = np.asarray(diameters_um, dtype=np.float64).ravel()
    if not (good := np.isfinite(array) & (array > 0)).all():
        raise ValueError(f"diameter {array[~good][0]} um: diameters must be finite, and above 0")
    return array


def _edges_um(least_um: float, most_um: float) -> FloatArray:
    first = np.floor(CLASSES_PER_DECADE * np.log10(least_um) + 1e-9)
    last = np.floor(CLASSES_PER_DECADE * np.log10(most_um) + 1e-9) + 1
    edges: FloatArray = 10 ** (np.arange(first, last + 1) / CLASSES_PER_DECADE)
    edges[0], edges[-1] = min(edges[0], least_um), max(edges[-1], np.nextafter(most_um, np.inf))
    return edges


def _size_class(
    span_um: tuple[float, float], droplets: tuple[int, int], shares: Sequence[FloatArray], exposures_per_shot: float
) -> SizeClass:
    (low_um, high_um), (first, last), (areas, volumes) = span_um, droplets, shares
    total = len(volumes) - 1
    unit = 1 / (total * (high_um - low_um))
    low, high = (exposures_per_shot * end * unit for end in garwood((last - first) / exposures_per_shot))
    return SizeClass(
        low_um=low_um,
        high_um=high_um,
        n=last - first,
        q0_per_um=Estimate(value=(last - first) * unit, low=low, high=high),
        q2_per_um=float(areas[last] - areas[first]) / (high_um - low_um),
        q3_per_um=float(volumes[last] - volumes[first]) / (high_um - low_um),
        cumulative_q0=last / total,
        cumulative_q2=float(areas[last]),
        cumulative_q3=float(volumes[last]),
    )


def _estimates(
    weighted: FloatArray, units: NDArray[np.intp], widening: float, confidence: float, number: int = DRAWS
) -> dict[str, Estimate]:
    """Figures of sorted diameters and their weights, with intervals; by logarithms, so that no limit is below 0."""
    diameters_um, weights = weighted.T
    powers = weights * diameters_um ** np.arange(5)[:, None]
    names = [*(f"d{p}{q}_um" for p, q in ORDERS), *BY_VOLUME, SPAN]
    told = estimated(
        lambda counts: _figures(diameters_um, powers, counts[:, units]),
        int(units.max()) + 1,
        len(diameters_um),
        number=number,
        widening=widening,
        signed=np.array([name == SPAN for name in names]),
        confidence=confidence,
    )
    known = {name: estimate for name, estimate in zip(names, told, strict=True) if estimate}
    if SPAN in known:
        known[SPAN] = known[SPAN].model_copy(update={"low": max(known[SPAN].low, 0.0)})
    return known


def _known(estimates: dict[str, Estimate], diameters_um: FloatArray, fewest: float) -> dict[str, Estimate]:
    """Estimates less quantiles without so many of the sorted diameters on either side; a span needs all of them."""
    quantiles_um = np.array([estimates[name].value for name in BY_VOLUME])
    smaller = np.searchsorted(diameters_um, quantiles_um)
    larger = len(diameters_um) - np.searchsorted(diameters_um, quantiles_um, side="right")
    unsure = {name for name, few in zip(BY_VOLUME, np.minimum(smaller, larger) < fewest, strict=True) if few}
    return {name: one for name, one in estimates.items() if name not in (unsure | {SPAN} if unsure else unsure)}


def _figures(diameters_um: FloatArray, powers: FloatArray, weights: FloatArray) -> FloatArray:
    """Mean diameters, quantiles by volume and relative span of sorted diameters; a row of each row of weights."""
    sums = powers @ weights.T
    means = [(sums[p] / sums[q]) ** (1 / (p - q)) for p, q in ORDERS]
    low_um, half_um, high_um = weighted_quantiles(diameters_um, powers[3] * weights, QUANTILES).T
    return np.column_stack([*means, low_um, half_um, high_um, (high_um - low_um) / half_um])
