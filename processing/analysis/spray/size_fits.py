"""SizeFit: distributions of two parameters, fitted to the volume of the droplets, and how far they are off.

* Lognormal: ``Q3(d) = Phi(ln(d / dv50) / s)``.
* Rosin and Rammler: ``Q3(d) = 1 - exp(-(d / X)^q)`` (Rosin and Rammler 1933; Lefebvre, Atomization and Sprays, ch. 3).

Both are fitted by maximum likelihood with every droplet weighted by its volume, so that they can be compared, and small
droplets that were not seen do little. Goodness is the largest gap between the curves of the cumulative volume; beside
it stands the gap that chance makes: 95 % of the draws lie closer to what was measured. Shots are drawn, and droplets,
and the larger gap counts: two shots have three draws only, which lie closer than droplets by chance do.
"""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.optimize import brentq
from scipy.special import gamma, ndtr

from processing.analysis.estimates import CONFIDENCE, Estimate, drawn_figures
from processing.analysis.spray.fit_intervals import LEAST_Q, MOST_Q, fit_estimates
from processing.analysis.spray.spray_sample import SpraySample
from processing.geometry import FloatArray
from processing.reconstruction.settings import FrozenValue

Name = Literal["lognormal", "rosin-rammler"]
FEWEST = 20
"""Droplets of different diameters of a fit."""
_LN_2 = float(np.log(2))


class SizeFit(FrozenValue):
    """A distribution of diameters by volume."""

    name: Annotated[Name, Field(description="which distribution")]
    scale_um: Annotated[float, Field(description="lognormal: median by volume; Rosin-Rammler: X, 63.2 % is smaller")]
    shape: Annotated[float, Field(description="lognormal: standard deviation of ln d; Rosin-Rammler: exponent q")]
    scale_within_um: Annotated[Estimate | None, Field(description="the same with its 95 % interval over shots")] = None
    shape_within: Annotated[
        Estimate | None,
        Field(description="likewise; both hold what larger droplets than all that were seen may make of them"),
    ] = None
    d32_um: Annotated[float | None, Field(description="Sauter's mean that it has; null where it has none: q up to 1")]
    dv50_um: Annotated[float, Field(description="median by volume that it has")]
    largest_gap: Annotated[float, Field(description="between its cumulative volume and the measured one, 0 to 1")]
    gap_by_chance: Annotated[float, Field(description="that 95 % of the draws of shots, and of droplets, stay below")]
    fits: Annotated[bool, Field(description="whether the gap is no larger than chance makes it")]

    @property
    def told_name(self) -> str:
        """As a text names it: after people, with capitals."""
        return self.name if self.name == "lognormal" else "Rosin-Rammler"

    def cumulative(self, diameters_um: FloatArray) -> FloatArray:
        """Share by volume of smaller droplets."""
        ratio = np.asarray(diameters_um, np.float64) / self.scale_um
        if self.name == "lognormal":
            return np.asarray(ndtr(np.log(ratio) / self.shape), np.float64)
        return np.asarray(-np.expm1(-(ratio**self.shape)), np.float64)

    def density_per_um(self, diameters_um: FloatArray) -> FloatArray:
        """Density by volume."""
        d_um = np.asarray(diameters_um, np.float64)
        ratio = d_um / self.scale_um
        if self.name == "lognormal":
            by_log: FloatArray = np.exp(-0.5 * (np.log(ratio) / self.shape) ** 2) / (self.shape * np.sqrt(2 * np.pi))
        else:
            by_log = self.shape * ratio**self.shape * np.exp(-(ratio**self.shape))
        return by_log / d_um


def size_fits(sample: SpraySample) -> tuple[SizeFit, ...]:
    """Both distributions, the better one first; none where there are fewer than 20 different diameters."""
    order = np.argsort(sample.diameters_um, kind="stable")
    d_um = sample.diameters_um[order]
    if len(np.unique(d_um)) < FEWEST:
        return ()
    weights = d_um**3 / np.sum(d_um**3)
    by_chance = _gap_by_chance(sample, order, weights)
    within = fit_estimates(sample)
    names: tuple[Name, Name] = ("lognormal", "rosin-rammler")
    fits = [_fit(name, d_um, weights, by_chance).model_copy(update=_within(*within[name])) for name in names]
    return tuple(sorted(fits, key=lambda fit: fit.largest_gap))


def _within(scale_um: Estimate | None, shape: Estimate | None) -> dict[str, Estimate | None]:
    return {"scale_within_um": scale_um, "shape_within": shape}


def _fit(name: Name, d_um: FloatArray, weights: FloatArray, by_chance: float) -> SizeFit:
    scale_um, shape = (_lognormal if name == "lognormal" else _rosin_rammler)(d_um, weights)
    fit = SizeFit(
        name=name,
        scale_um=scale_um,
        shape=shape,
        d32_um=_sauter_um(name, scale_um, shape),
        dv50_um=scale_um if name == "lognormal" else scale_um * _LN_2 ** (1 / shape),
        largest_gap=0.0,
        gap_by_chance=by_chance,
        fits=True,
    )
    gap = _gap(fit.cumulative(d_um), np.cumsum(weights), weights)
    return fit.model_copy(update={"largest_gap": gap, "fits": gap <= by_chance})


def _lognormal(d_um: FloatArray, weights: FloatArray) -> tuple[float, float]:
    logs = np.log(d_um)
    mean = float(weights @ logs)
    return float(np.exp(mean)), float(np.sqrt(weights @ (logs - mean) ** 2))


def _rosin_rammler(d_um: FloatArray, weights: FloatArray) -> tuple[float, float]:
    """Exponent where the derivative of the likelihood vanishes; it falls all along."""
    logs = np.log(d_um / d_um.max())
    mean = float(weights @ logs)

    def slope(q: float) -> float:
        powers = weights * np.exp(q * logs)
        return 1 / q + mean - float(powers @ logs / powers.sum())

    q = float(brentq(slope, LEAST_Q, MOST_Q)) if slope(MOST_Q) < 0 else MOST_Q
    return float(d_um.max() * np.sum(weights * np.exp(q * logs)) ** (1 / q)), q


def _sauter_um(name: str, scale_um: float, shape: float) -> float | None:
    """1 / (mean of 1 / d by volume)."""
    if name == "lognormal":
        return float(scale_um * np.exp(-(shape**2) / 2))
    return float(scale_um / gamma(1 - 1 / shape)) if shape > 1 else None


def _gap(fitted: FloatArray, upper: FloatArray, weights: FloatArray) -> float:
    """Largest distance from the steps of what was measured, before and after each droplet."""
    return float(max(np.max(np.abs(fitted - upper)), np.max(np.abs(fitted - upper + weights))))


def _gap_by_chance(sample: SpraySample, order: NDArray[np.intp], weights: FloatArray) -> float:
    """Of draws of droplets, and where there are several shots of draws of these; the larger one."""
    by_droplet = np.arange(len(order))
    gap = np.sqrt(sample.exposures_per_shot) * _gap_of_draws(by_droplet, len(order), weights, counting=True)
    if sample.several:
        gap = max(gap, _gap_of_draws(sample.units[order], sample.n_units, weights, counting=False))
    return float(min(gap, 1.0))


def _gap_of_draws(units: NDArray[np.intp], n_units: int, weights: FloatArray, *, counting: bool) -> float:
    measured = np.cumsum(weights)

    def gaps_of(counts: FloatArray) -> FloatArray:
        drawn = np.cumsum(counts[:, units] * weights, axis=1)
        with np.errstate(invalid="ignore"):
            gaps: FloatArray = np.max(np.abs(drawn / drawn[:, -1:] - measured), axis=1, keepdims=True)
        return gaps

    _, drawn = drawn_figures(gaps_of, n_units, len(units), counting=counting)
    return float(np.nanquantile(drawn, CONFIDENCE))
