"""Sprays whose droplets are sampled directly, shot by shot, and what their figures are by theory.

Shots differ: the number of droplets is a Poisson variate whose mean is gamma distributed, and each shot has a median of
its own. Nothing here knows of the statistics that are judged by it.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import gamma, ndtri

from processing.analysis.spray.spray_sample import SpraySample
from processing.geometry import FloatArray

MEDIAN_UM, BOX_MM3 = 40.0, 100.0
SPEED_M_S, SPEED_PER_UM = 5.0, 0.1
"""Speed along the axis is the first plus the second times the diameter: large ones fly faster."""
ALIKE = 0.01
"""Shots whose medians differ by less are called alike."""
Law = Literal["lognormal", "rosin-rammler"]


@dataclass(frozen=True)
class SprayCase:
    """A spray, and how much of it is seen.

    Parameters
    ----------
    shots : int
        How many.
    droplets : float
        Of a shot, on average.
    spread : float
        Lognormal: standard deviation of ln d by number; Rosin and Rammler: their exponent, above 3.
    law : str
        Of the diameters.
    between : float
        Standard deviation of ln of the medians of the shots; of lognormal sprays.
    numbers : float
        Standard deviation of the mean number of droplets of shots, over its mean.
    asked : bool
        Whether intervals must hold the truth as often as they say; else it is measured how often they do.
    """

    shots: int
    droplets: float
    spread: float
    law: Law = "lognormal"
    between: float = 0.04
    numbers: float = 0.3
    asked: bool = True

    @property
    def name(self) -> str:
        """For tables and figures."""
        alike = ", shots alike" if self.between < ALIKE else ""
        return f"{self.shots} shots of {self.droplets:g} droplets, {self.law} {self.spread:g}{alike}"


def sampled(case: SprayCase, rng: np.random.Generator) -> SpraySample:
    """A realisation: the droplets of all shots, one exposure each, in a box of 100 mm3."""
    means = case.droplets * rng.gamma(case.numbers**-2, case.numbers**2, case.shots)
    shots = [_diameters_um(case, int(count), rng) for count in rng.poisson(means)]
    d_um = np.concatenate(shots)
    velocities = np.zeros((len(d_um), 3))
    velocities[:, 1] = SPEED_M_S + SPEED_PER_UM * d_um
    return SpraySample(
        diameters_um=d_um,
        points_mm=np.zeros((len(d_um), 3)),
        velocities_m_s=velocities,
        shot=np.repeat(np.arange(case.shots), [len(shot) for shot in shots]),
        volumes_mm3=np.full(case.shots, BOX_MM3),
    )


def _diameters_um(case: SprayCase, count: int, rng: np.random.Generator) -> FloatArray:
    if case.law == "lognormal":
        median_um = MEDIAN_UM * np.exp(case.between * rng.standard_normal())
        return np.asarray(median_um * np.exp(case.spread * rng.standard_normal(count)))
    return np.asarray(MEDIAN_UM * rng.gamma(1 - 3 / case.spread, 1, count) ** (1 / case.spread))


def true_figures(case: SprayCase) -> dict[str, float]:
    """D32, Dv0.5, relative span and volume flux in mm/s, by the moments of the distribution."""
    moments_um = {order: _moment(case, order) for order in (2, 3, 4)}
    low_um, half_um, high_um = (_volume_quantile_um(case, share) for share in (0.1, 0.5, 0.9))
    carried = SPEED_M_S * moments_um[3] + SPEED_PER_UM * moments_um[4]
    return {
        "d32": moments_um[3] / moments_um[2],
        "dv50": half_um,
        "span": (high_um - low_um) / half_um,
        "flux": 1e3 * np.pi / 6 * 1e-9 * case.droplets * carried / BOX_MM3,
    }


def _spread(case: SprayCase) -> float:
    """Of all droplets of all shots."""
    return float(np.hypot(case.spread, case.between))


def _moment(case: SprayCase, order: int) -> float:
    """Mean of d to an order; of Rosin and Rammler (d / X)^q is gamma distributed by number, of order 1 - 3 / q."""
    if case.law == "lognormal":
        return float(MEDIAN_UM**order * np.exp(order**2 * _spread(case) ** 2 / 2))
    first = 1 - 3 / case.spread
    return float(MEDIAN_UM**order * gamma(first + order / case.spread) / gamma(first))


def _volume_quantile_um(case: SprayCase, share: float) -> float:
    if case.law == "lognormal":
        spread = _spread(case)
        return float(MEDIAN_UM * np.exp(3 * spread**2 + spread * ndtri(share)))
    return float(MEDIAN_UM * (-np.log1p(-share)) ** (1 / case.spread))
