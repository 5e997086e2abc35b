"""SprayMotion: how fast droplets fly, and what flows: spatial figures, and those weighted by velocity beside them.

A flash sees the droplets that are in a volume: *spatial* sampling, by concentration. Patternators and phase Doppler see
those that pass an area: *flux-sensitive* sampling (ASTM E799 has both words, and prescribes no conversion). One is made
of the other by weighting each droplet with its velocity along the axis: ``D_pq = (sum |u| d^p / sum |u| d^q)^(1 / (p -
q))``.

Volume flux along the axis, of liquid per area and time, is ``pi / 6 sum d^3 u / V``, V the measured volume. Droplets
without partner take the mean velocity by volume of those that have one.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import Field

from processing.analysis.droplets.size_statistics import size_classes
from processing.analysis.estimates import CONFIDENCE, Estimate, Figures, weighted_quantiles
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_sample import SpraySample
from processing.geometry import FloatArray
from processing.reconstruction.settings import FrozenValue

FEWEST = 5
"""Droplets with a velocity in a row of a table, and in all."""
RINGS = 8
ALIKE = 1e-9
"""Of a number: what differs by less is the same."""
MM3_PER_UM3 = 1e-9
MM_S_PER_M_S = 1e3
NO_VELOCITIES = "fewer than 5 droplets have a velocity: measure a run of two exposures, A and B, with velocities"
NO_AXIS = (
    "nozzle and axis of the spray are not known: state them with --nozzle X,Y,Z --axis X,Y,Z, or in the run's notes"
)
ALL_ALIKE = "all diameters or all speeds are the very same, so there is no correlation"
AGAINST = "no liquid flows along the stated axis in the mean, so there is no flux: is its direction stated rightly?"
NO_DENSITY = "the density of the liquid is not known: state it with --liquid-density KG_M3"
FLUX_WEIGHTING = "each droplet that has a velocity, by the amount of its velocity along the axis"


class VelocityRow(FrozenValue):
    """Mean velocities of some droplets, by number."""

    low: Annotated[float, Field(description="of the diameter in um, or of the distance from the axis in mm")]
    high: Annotated[float, Field(description="of the same")]
    n: Annotated[int, Field(description="droplets with a velocity")]
    speed_m_s: Annotated[Estimate | None, Field(description="amount; null of fewer than 5 droplets")] = None
    axial_m_s: Annotated[Estimate | None, Field(description="along the axis; null without one")] = None
    radial_m_s: Annotated[Estimate | None, Field(description="away from the axis; null without one")] = None


class SprayMotion(FrozenValue):
    """Velocities of the droplets, and flux."""

    paired_share: Annotated[float, Field(description="of the droplets: those that have a velocity")]
    mean_m_s: Annotated[
        tuple[Estimate | None, Estimate | None, Estimate | None], Field(description="u, v, w along x, y, z; by number")
    ]
    speed_m_s: Annotated[Estimate | None, Field(description="mean amount, by number")]
    size_speed_correlation: Annotated[
        Estimate | None, Field(description="of the ranks of diameter and speed, Spearman's")
    ]
    by_size: Annotated[tuple[VelocityRow, ...], Field(description="by classes of the diameter, R20")]
    by_radius: Annotated[tuple[VelocityRow, ...], Field(description="by distance from the axis")] = ()
    axial_m_s: Annotated[Estimate | None, Field(description="mean along the axis, by number")] = None
    volume_flux_mm_s: Annotated[Estimate | None, Field(description="liquid per area and time, mm3/(mm2 s)")] = None
    mass_flux_kg_m2_s: Annotated[Estimate | None, Field(description="the same times the stated density")] = None
    flux_d10_um: Annotated[Estimate | None, Field(description="D10, flux-weighted")] = None
    flux_d32_um: Annotated[Estimate | None, Field(description="D32, flux-weighted")] = None
    flux_dv50_um: Annotated[Estimate | None, Field(description="median by volume, flux-weighted")] = None
    flux_weighting: Annotated[str, Field(description="how flux-weighted figures are weighted")] = FLUX_WEIGHTING
    liquid_kg_m3: Annotated[float | None, Field(description="density of the liquid, as stated")] = None
    reason: Annotated[str | None, Field(description="why something is null")] = None


def spray_motion(sample: SpraySample, axis: SprayAxis | None, liquid_kg_m3: float | None = None) -> SprayMotion | None:
    """Velocities and flux of a sample; None where fewer than 5 droplets have a velocity.

    Parameters
    ----------
    sample : SpraySample
        The droplets.
    axis : SprayAxis | None
        Of the spray; without it there is no flux.
    liquid_kg_m3 : float | None
        Density of the liquid; without it there is no mass.
    """
    paired = sample.chosen(sample.paired)
    if len(paired) < FEWEST:
        return None
    speeds_m_s = np.linalg.norm(paired.velocities_m_s, axis=1)
    *mean_m_s, speed = _means(paired, np.column_stack([paired.velocities_m_s, speeds_m_s]), signed=[True] * 3 + [False])
    correlation = _rank_correlation(paired, speeds_m_s)
    flowing = _flow(sample, paired, axis, liquid_kg_m3) if axis else {}
    has_flux = flowing.get("volume_flux_mm_s") is not None
    no_flux = NO_AXIS if axis is None else None if has_flux else AGAINST
    no_mass = NO_DENSITY if axis and not liquid_kg_m3 else None
    reasons = (None if correlation else ALL_ALIKE, no_flux, no_mass)
    told = {
        "paired_share": len(paired) / len(sample),
        "mean_m_s": tuple(mean_m_s),
        "speed_m_s": speed,
        "size_speed_correlation": correlation,
        "by_size": _by_size(paired, axis),
        "liquid_kg_m3": liquid_kg_m3,
        "reason": "; ".join(filter(None, reasons)) or None,
        **flowing,
    }
    return SprayMotion.model_validate(told)


def all_alike(values: FloatArray) -> bool:
    """Whether values do not differ, but for rounding."""
    return bool(np.ptp(values) <= ALIKE * np.abs(values).max())


def axial_volumes(sample: SpraySample, axis: SprayAxis) -> FloatArray:
    """What each droplet carries along the axis, ``d^3 u``, (N,); where none has a velocity, ``d^3``.

    Droplets without partner take the mean velocity by volume of those that have one.
    """
    axial_m_s = axis.frame[0] @ sample.velocities_m_s.T
    paired = sample.paired
    if not paired.any():
        return sample.cubes_um3
    mean_m_s = np.average(axial_m_s[paired], weights=sample.cubes_um3[paired])
    return np.asarray(sample.cubes_um3 * np.where(paired, axial_m_s, mean_m_s))


def _flow(sample: SpraySample, paired: SpraySample, axis: SprayAxis, liquid_kg_m3: float | None) -> dict[str, object]:
    axial_m_s = axis.frame[0] @ paired.velocities_m_s.T
    (axial,) = _means(paired, axial_m_s[:, None], signed=[True])
    flux = volume_flux(sample, axis)
    flux_d10, flux_d32, flux_dv50 = _flux_diameters(paired, np.abs(axial_m_s))
    return {
        "axial_m_s": axial,
        "by_radius": _by_radius(paired, axis),
        "volume_flux_mm_s": flux,
        "mass_flux_kg_m2_s": _times(flux, liquid_kg_m3 / MM_S_PER_M_S) if liquid_kg_m3 and flux else None,
        "flux_d10_um": flux_d10,
        "flux_d32_um": flux_d32,
        "flux_dv50_um": flux_dv50,
    }


def _means(sample: SpraySample, values: FloatArray, signed: Sequence[bool]) -> list[Estimate | None]:
    """Means by number of columns of values."""

    def means_of(drawn: SpraySample) -> Figures:
        total = drawn.totals(np.column_stack([values, np.ones(len(drawn))]))
        return lambda counts: _ratios(total(counts))

    return sample.estimated(means_of, signed=np.array(signed))


def _ratios(sums: FloatArray) -> FloatArray:
    """Of columns to the last one."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(sums[:, :-1] / sums[:, -1:])


def volume_flux(sample: SpraySample, axis: SprayAxis, confidence: float = CONFIDENCE) -> Estimate | None:
    """Liquid per area and time along the axis, in mm/s; droplets without partner are drawn with the others."""
    axial_m_s = np.where(sample.paired, axis.frame[0] @ sample.velocities_m_s.T, 0.0)
    columns = np.column_stack([sample.cubes_um3, sample.cubes_um3 * sample.paired, sample.cubes_um3 * axial_m_s])

    def flux_of(drawn: SpraySample) -> Figures:
        total = drawn.totals(columns)
        return lambda counts: _flux(total(counts), drawn.measured_mm3(counts))

    (one,) = sample.estimated(flux_of, signed=sample.has_empty_shots, confidence=confidence)
    return one and one.within(0.0, np.inf)


def _flux(sums: FloatArray, measured_mm3: FloatArray) -> FloatArray:
    """Of all liquid, of what has a velocity, and of what that carries, (rows, 3)."""
    liquid, known, moved = np.moveaxis(sums, 1, 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        carried = liquid * moved / known
    return np.asarray(MM_S_PER_M_S * MM3_PER_UM3 * np.pi / 6 * carried[:, None] / measured_mm3)


def _flux_diameters(sample: SpraySample, weights: FloatArray) -> list[Estimate | None]:
    order = np.argsort(sample.diameters_um, kind="stable")
    d_um = sample.diameters_um[order]
    columns = weights[:, None] * sample.diameters_um[:, None] ** np.arange(4)
    by_volume = columns[order, 3]

    def diameters_of(drawn: SpraySample) -> Figures:
        units, total = drawn.units[order], drawn.totals(columns)

        def diameters(counts: FloatArray) -> FloatArray:
            sums = total(counts)
            with np.errstate(invalid="ignore", divide="ignore"):
                d10, d32 = sums[:, 1] / sums[:, 0], sums[:, 3] / sums[:, 2]
            return np.column_stack([d10, d32, weighted_quantiles(d_um, counts[:, units] * by_volume, (0.5,))])

        return diameters

    return sample.estimated(diameters_of, by_droplet=True)


def _rank_correlation(sample: SpraySample, speeds_m_s: FloatArray) -> Estimate | None:
    """Pearson's correlation of the ranks in the whole sample; limits stay within -1 and 1.

    Where all diameters or all speeds are alike there is none.
    """
    from scipy.stats import rankdata  # takes 0.4 s to load, which a server that starts has no use for

    if all_alike(sample.diameters_um) or all_alike(speeds_m_s):
        return None
    ranks = np.column_stack([rankdata(sample.diameters_um), rankdata(speeds_m_s)])
    x, y = (ranks / len(ranks) - 0.5).T
    columns = np.column_stack([np.ones(len(x)), x, y, x * x, y * y, x * y])

    def correlation_of(drawn: SpraySample) -> Figures:
        total = drawn.totals(columns)
        return lambda counts: _correlation(total(counts))

    (one,) = sample.estimated(correlation_of, signed=True)
    return one and one.within(-1.0, 1.0)


def _correlation(sums: FloatArray) -> FloatArray:
    """Pearson's, (rows, 1), of sums of 1, x, y, x x, y y, x y."""
    n, sx, sy, sxx, syy, sxy = np.moveaxis(sums, 1, 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray((sxy - sx * sy / n) / np.sqrt((sxx - sx**2 / n) * (syy - sy**2 / n)))[:, None]


def _by_size(sample: SpraySample, axis: SprayAxis | None) -> tuple[VelocityRow, ...]:
    edges_um = [(one.low_um, one.high_um) for one in size_classes(sample.diameters_um) if one.n]
    return tuple(_row(sample, sample.diameters_um, edges, axis) for edges in edges_um)


def _by_radius(sample: SpraySample, axis: SprayAxis) -> tuple[VelocityRow, ...]:
    _, radius_mm, _ = axis.coordinates(sample.points_mm)
    edges_mm = np.linspace(0, np.nextafter(radius_mm.max(), np.inf), RINGS + 1).tolist()
    return tuple(_row(sample, radius_mm, edges, axis) for edges in pairwise(edges_mm))


def _row(sample: SpraySample, by: FloatArray, edges: tuple[float, float], axis: SprayAxis | None) -> VelocityRow:
    chosen = sample.chosen((by >= edges[0]) & (by < edges[1]))
    row = VelocityRow(low=edges[0], high=edges[1], n=len(chosen))
    if len(chosen) < FEWEST:
        return row
    columns = [np.linalg.norm(chosen.velocities_m_s, axis=1)]
    if axis:
        columns += axis.components(chosen.velocities_m_s, chosen.points_mm)
    names = ("speed_m_s", "axial_m_s", "radial_m_s")[: len(columns)]
    means = _means(chosen, np.column_stack(columns), signed=[False, True, True][: len(columns)])
    return row.model_copy(update=dict(zip(names, means, strict=True)))


def _times(one: Estimate, factor: float) -> Estimate:
    return Estimate(value=factor * one.value, low=factor * one.low, high=factor * one.high)
