"""Tables of a spray: figures with their units and intervals, for reports and for the command line."""

from collections.abc import Iterator, Mapping, Sequence

from processing.analysis.estimates import Estimate
from processing.analysis.spray.detection import LEAST_FOUND, ClassDetection
from processing.analysis.spray.patternation import Patternation
from processing.analysis.spray.size_fits import SizeFit
from processing.analysis.spray.spray_statistics import SprayStatistics
from server.reports.digits import digits_of_interval, three_digits
from server.reports.page import Table

Row = list[str]


OF_DROPLETS = {
    **{f"d{order}_um": f"D{order} [µm]" for order in (10, 20, 30, 32, 43)},
    **{f"dv{percent}_um": f"Dv0.{percent // 10} [µm]" for percent in (10, 50, 90)},
    "relative_span": "relative span",
}
OF_MOTION = {
    "speed_m_s": "mean speed [m/s]",
    "axial_m_s": "mean axial velocity [m/s]",
    "volume_flux_mm_s": "volume flux [mm³/(mm² s)]",
    "mass_flux_kg_m2_s": "mass flux [kg/(m² s)]",
    "size_speed_correlation": "rank correlation, diameter and speed",
    "flux_d10_um": "D10, flux-weighted [µm]",
    "flux_d32_um": "D32, flux-weighted [µm]",
    "flux_dv50_um": "Dv0.5, flux-weighted [µm]",
}
OF_EXTENT = {
    "cone_angle_deg": "cone angle, 90 % of the liquid [°]",
    "cone_angle_half_deg": "cone angle, 50 % of the liquid [°]",
    "penetration_mm": "penetration, 99 % of the liquid [mm]",
}
DENSITY, LIQUID = "number density [1/mm³]", "liquid in droplets [ppm of volume]"
LABELS = {"number_density_per_mm3": DENSITY, "liquid_ppm": LIQUID, **OF_DROPLETS, **OF_MOTION, **OF_EXTENT}
"""Figures as people read them, by the names that programs do."""


def figure_rows(told: SprayStatistics) -> list[Row]:
    """Name with unit, value and interval of every figure that a spray has."""
    return [[name, *cells_of(estimate)] for name, estimate in _figures(told) if estimate]


def _figures(told: SprayStatistics) -> Iterator[tuple[str, Estimate | None]]:
    droplets = told.droplets
    yield DENSITY, droplets.number_density_per_mm3
    yield LIQUID, told.liquid_ppm
    yield from _of(droplets, OF_DROPLETS)
    yield "ghosts expected among them [%]", droplets.ghost_share and in_percent(droplets.ghost_share)
    yield "ghosts by droplets without partner [%]", told.unpaired_ghost_share and in_percent(told.unpaired_ghost_share)
    yield from _of(told.motion, OF_MOTION)
    yield from _of(told.extent, OF_EXTENT)


def _of(part: object, labels: Mapping[str, str]) -> Iterator[tuple[str, Estimate | None]]:
    return ((label, getattr(part, name)) for name, label in labels.items() if part)


def in_percent(share: Estimate) -> Estimate:
    """A share of ghosts, with no more digits than it bears."""
    value, low, high = (round(100 * one, 2) for one in (share.value, share.low, share.high))
    return Estimate(value=value, low=low, high=high)


def cells_of(estimate: Estimate) -> Row:
    """Value, and interval."""
    value, low, high = digits_of_interval(estimate.value, estimate.low, estimate.high)
    return [value, f"{low} to {high}"]


def figures_table(told: SprayStatistics, more: Sequence[Row] = ()) -> Table:
    """All figures of a spray, and rows of what is told of it beside them."""
    return Table(["figure", "value", "95 % interval"], [*figure_rows(told), *more])


def doubts(told: SprayStatistics) -> list[str]:
    """What is doubtful, unsure or missing, and what to do."""
    said = [*told.doubts, *(told.sample.reasons if told.sample else ())]
    said += _grouped(told.reasons)
    if lacking := _lacking(told):
        said.append(f"No {', '.join(lacking)}: {told.droplets.reason}")
    if told.droplets.n and told.droplets.ghost_reason:
        said.append(f"No share of ghosts: {told.droplets.ghost_reason}")
    if told.motion and told.motion.reason and not any(told.motion.reason in one for one in said):
        said.append(told.motion.reason)
    if told.extent:
        reached = (("cone angle", told.extent.cone_reason), ("penetration", told.extent.penetration_reason))
        said += [f"No {name}: {why}" for name, why in reached if why]
    said += [f"No shares at {one.at_mm:.3g} mm: {one.reason}" for one in told.patternations if one.reason]
    return [*said, *(one.text for one in told.not_checked)]


def twice(told: SprayStatistics) -> str:
    """That each droplet is counted in two exposures; empty where it is not."""
    return " (A and B show the same droplets)" if told.droplets.exposures > told.droplets.shots else ""


def _grouped(reasons: Mapping[str, str]) -> list[str]:
    """What is missing for one reason, in one line."""
    missing: dict[str, list[str]] = {}
    for name, reason in reasons.items():
        missing.setdefault(reason, []).append(name)
    return [f"No {', '.join(names)}: {reason}" for reason, names in missing.items()]


def _lacking(told: SprayStatistics) -> list[str]:
    """Means and quantiles that are not told although others are."""
    droplets = told.droplets
    quantiles = {"Dv0.1": droplets.dv10_um, "Dv0.5": droplets.dv50_um, "Dv0.9": droplets.dv90_um}
    return [name for name, one in (*quantiles.items(), ("span", droplets.relative_span)) if droplets.d32_um and not one]


def _within(value: float, estimate: Estimate | None) -> str:
    if estimate is None:
        return three_digits(value)
    return f"{three_digits(value)} ({three_digits(estimate.low)} to {three_digits(estimate.high)})"


def fits_table(fits: tuple[SizeFit, ...]) -> Table:
    """Distributions that were fitted."""
    rows = [
        [
            fit.told_name,
            _within(fit.scale_um, fit.scale_within_um),
            _within(fit.shape, fit.shape_within),
            "" if fit.d32_um is None else three_digits(fit.d32_um),
            three_digits(fit.dv50_um),
            f"{fit.largest_gap:.3f}",
            f"{fit.gap_by_chance:.3f}",
            "yes" if fit.fits else "no",
        ]
        for fit in fits
    ]
    head = [
        "distribution by volume",
        "scale [µm], 95 %",
        "shape, 95 %",
        "D32 [µm]",
        "Dv0.5 [µm]",
        "largest gap",
        "by chance",
        "fits",
    ]
    return Table(head, rows)


def classes_table(told: SprayStatistics) -> Table:
    """Classes of diameters after ISO 9276-1."""
    rows = [
        [
            f"{one.low_um:#.4g} to {one.high_um:#.4g}",
            f"{one.n}",
            three_digits(one.q0_per_um.value),
            three_digits(one.q2_per_um),
            three_digits(one.q3_per_um),
            f"{one.cumulative_q0:.3f}",
            f"{one.cumulative_q2:.3f}",
            f"{one.cumulative_q3:.3f}",
        ]
        for one in told.classes
    ]
    head = ["diameter [µm]", "n", "q0 [1/µm]", "q2 [1/µm]", "q3 [1/µm]", "Q0", "Q2", "Q3"]
    caption = (
        "Classes of diameters, ISO 9276-1: densities q and cumulative shares Q by number (0), area (2), volume (3)"
    )
    return Table(head, rows, caption=caption)


def detection_table(classes: tuple[ClassDetection, ...]) -> Table:
    """What is found of each class, by twins, and how many there are then."""
    rows = [
        [
            f"{one.low_um:#.4g} to {one.high_um:#.4g}",
            f"{one.n}",
            f"{one.placed}",
            *(_percent(one.found_share) if one.found_share else ["", ""]),
            _within(one.n_corrected.value, one.n_corrected) if one.n_corrected else "not known",
        ]
        for one in classes
    ]
    head = ["diameter [µm]", "n", "in twins", "found of these [%]", "95 % interval [%]", "n corrected, 95 %"]
    caption = f"Found by twins, and n over that share, where it is surely not below {100 * LEAST_FOUND:g} %"
    return Table(head, rows, caption=caption)


def patternation_table(one: Patternation) -> Table:
    """Shares of the sectors."""
    step = 360 / one.sectors
    rows = [
        [f"{step * number:g}° to {step * (number + 1):g}°", *(_percent(share) if share else ["", ""])]
        for number, share in enumerate(one.sector_shares)
    ]
    caption = f"Patternation {one.at_mm:.3g} mm from the nozzle: {one.weighting}"
    return Table(["sector", "share [%]", "95 % interval [%]"], rows, caption=caption)


def _percent(share: Estimate) -> Row:
    return [f"{100 * share.value:.1f}", f"{100 * share.low:.1f} to {100 * share.high:.1f}"]
