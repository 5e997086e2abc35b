"""Differences of runs, figure by figure, and whether they are more than shots scatter.

The logarithms of a figure of two runs differ by ``z`` standard errors, which come from the intervals over shots;
Welch's t test with the degrees of freedom of Satterthwaite says how often chance does as much. Many figures of many
pairs are looked at, so Holm's correction is applied to all: that chance makes *any* of them significant has 5 %.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.special import stdtr, stdtrit

from processing.analysis.droplets.droplet_statistics import DropletStatistics
from processing.analysis.droplets.sizes_in_light import by_shots
from processing.analysis.estimates import CONFIDENCE, Estimate, reach
from processing.analysis.spray.spray_statistics import SprayStatistics
from processing.count import counted
from processing.reconstruction.settings import FrozenValue

OF_DROPLETS = ("number_density_per_mm3", "d10_um", "d32_um", "dv10_um", "dv50_um", "dv90_um", "relative_span")
OF_MOTION = ("speed_m_s", "volume_flux_mm_s", "flux_d32_um")
OF_EXTENT = ("cone_angle_deg", "cone_angle_half_deg", "penetration_mm")
FEWEST_SHOTS = 2
NOTHING = (
    "no two runs have a figure of several shots in common; one shot says nothing of how shots differ: measure more"
)


class Difference(FrozenValue):
    """A figure of two runs."""

    figure: Annotated[str, Field(description="name of the figure")]
    first: Annotated[str, Field(description="a run")]
    second: Annotated[str, Field(description="the other run")]
    ratio: Annotated[Estimate, Field(description="of the second to the first, with 95 %, uncorrected")]
    p_value: Annotated[float, Field(description="how often chance makes as much of a difference, by itself")]
    p_corrected: Annotated[float, Field(description="the same among all that are compared, Holm's correction")]
    significant: Annotated[bool, Field(description="whether p_corrected is below 0.05")]


@dataclass(frozen=True)
class _Told:
    """Logarithm of a figure, its standard error and degrees of freedom."""

    log: float
    error: float
    freedom: int


def differences(runs: Mapping[str, SprayStatistics]) -> tuple[Difference, ...]:
    """Differences of all pairs of runs, for each figure that both have.

    Parameters
    ----------
    runs : mapping of name to SprayStatistics
        Of two shots at least; figures of runs of one shot are not compared.
    """
    told = {name: _told(statistics) for name, statistics in runs.items()}
    compared = [one for pair in combinations(told, 2) for one in _compared(told, *pair)]
    corrected = _holm([one.p_value for one in compared])
    return tuple(
        one.model_copy(update={"p_corrected": p, "significant": p < 1 - CONFIDENCE})
        for one, p in zip(compared, corrected, strict=True)
    )


def not_compared(runs: Mapping[str, SprayStatistics]) -> tuple[str, ...]:
    """Say which runs have no figure that can be compared, and why: else nothing is said of an empty run beside another.

    Parameters
    ----------
    runs
        As of ``differences``.
    """
    return tuple(
        f"{name}: no figure of it is compared: {_why_not(one.droplets)}" for name, one in runs.items() if not _told(one)
    )


def _why_not(droplets: DropletStatistics) -> str:
    if not droplets.n:
        return f"none of its {counted(droplets.exposures, 'exposure')} that count has a droplet"
    if droplets.shots < FEWEST_SHOTS:
        return f"all its {counted(droplets.n, 'droplet')} are in one shot, which says nothing of how shots differ"
    return droplets.reason or "its shots have no figure with an interval"


def _told(statistics: SprayStatistics) -> dict[str, _Told]:
    """Figures of a run that can be compared, by their names."""
    shots = statistics.droplets.shots
    if shots < FEWEST_SHOTS:
        return {}
    parts = ((statistics.motion, OF_MOTION), (statistics.extent, OF_EXTENT))
    estimates = {name: getattr(part, name) for part, names in parts if part for name in names}
    estimates |= {name: by_shots(statistics.droplets, name) for name in OF_DROPLETS}
    estimates["liquid_ppm"] = statistics.liquid_ppm
    return {
        name: _Told(float(np.log(one.value)), (one.high - one.low) / (2 * one.value * reach(shots)), shots - 1)
        if one.low <= 0
        else _Told(float(np.log(one.value)), float(np.log(one.high / one.low)) / (2 * reach(shots)), shots - 1)
        for name, one in estimates.items()
        if one and one.value > 0
    }


def _compared(told: Mapping[str, Mapping[str, _Told]], first: str, second: str) -> Iterator[Difference]:
    for figure in (name for name in told[first] if name in told[second]):
        a, b = told[first][figure], told[second][figure]
        error = float(np.hypot(a.error, b.error))
        if not error:
            continue
        freedom = error**4 / (a.error**4 / a.freedom + b.error**4 / b.freedom)
        p = float(2 * stdtr(freedom, -abs(b.log - a.log) / error))
        half = float(stdtrit(freedom, 1 - (1 - CONFIDENCE) / 2)) * error
        low, value, high = np.exp(b.log - a.log + np.array([-half, 0, half])).tolist()
        ratio = Estimate(value=value, low=low, high=high)
        yield Difference(
            figure=figure, first=first, second=second, ratio=ratio, p_value=p, p_corrected=p, significant=False
        )


def _holm(p_values: Sequence[float]) -> list[float]:
    """Holm 1979: the smallest times their number, the next times one less, and none smaller than one before."""
    order = np.argsort(p_values)
    factors = len(p_values) - np.arange(len(p_values))
    corrected = np.empty(len(p_values))
    corrected[order] = np.minimum(np.maximum.accumulate(np.array(p_values)[order] * factors), 1.0)
    return [float(p) for p in corrected]
