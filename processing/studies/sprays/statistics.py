"""How often 90 % intervals of D32, Dv0.5, relative span and mass flux hold the truth: in 85 to 95 % of 200 sprays."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from processing.analysis.droplets.size_statistics import mean_diameters
from processing.analysis.estimates import Estimate
from processing.analysis.spray.sample_size import MOST_EXTREME, extreme_droplet
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_motion import volume_flux
from processing.analysis.spray.spray_sample import SpraySample
from processing.figures.sprays.coverage_figure import coverage_figure
from processing.studies.report import Statement
from processing.studies.sprays.simulated_sprays import SprayCase, sampled, true_figures

FIGURES = {"d32": "D32", "dv50": "Dv0.5", "span": "span", "flux": "mass flux"}
CONFIDENCE = 0.9
LEAST_HELD, MOST_HELD = 0.85, 0.95
AXIS = SprayAxis((0, 0, 0), (0, 1, 0))
CASES = (
    SprayCase(3, 400, 0.25),
    SprayCase(5, 300, 0.25),
    SprayCase(10, 200, 0.3),
    SprayCase(20, 100, 0.3),
    SprayCase(40, 100, 0.35),
    SprayCase(10, 1000, 0.4),
    SprayCase(10, 400, 4.0, law="rosin-rammler"),
    SprayCase(2, 500, 0.25, asked=False),
    *(SprayCase(shots, 100, 0.25, asked=False) for shots in (2, 3, 5)),
    *(SprayCase(shots, 100, 0.25, between=0.001, numbers=0.02, asked=False) for shots in (2, 3, 5)),
    SprayCase(5, 20, 0.4, asked=False),
    SprayCase(10, 100, 0.4, asked=False),
    SprayCase(10, 100, 0.6, asked=False),
    SprayCase(40, 100, 0.6, asked=False),
)


@dataclass(frozen=True)
class StatisticsStudy:
    """Which sprays, and how often.

    Parameters
    ----------
    cases : tuple of SprayCase
        What is sampled.
    sprays : int
        Realisations of each.
    seed : int
        Of the first.
    """

    cases: tuple[SprayCase, ...] = CASES
    sprays: int = 200
    seed: int = 501


@dataclass(frozen=True)
class StatisticsRow:
    """A case: how often intervals that are told hold the truth (None: none is), and the largest droplet's share."""

    case: str
    sprays: int
    d32_held: float | None
    dv50_held: float | None
    span_held: float | None
    flux_held: float | None
    least_told: float
    extreme_share: float
    low_samples: float
    asked: bool


def statistics_study(study: StatisticsStudy | None = None) -> Iterator[StatisticsRow]:
    """Sample, estimate and compare, case by case. The same study gives the same rows."""
    study = study or StatisticsStudy()
    for case in study.cases:
        yield _row(case, study)


def _row(case: SprayCase, study: StatisticsStudy) -> StatisticsRow:
    truth = true_figures(case)
    held: dict[str, list[bool]] = {name: [] for name in FIGURES}
    shares, low = [], 0
    for number in range(study.sprays):
        sample = sampled(case, np.random.default_rng([study.seed, number]))
        for name, estimate in _estimates(sample).items():
            if estimate:
                held[name].append(estimate.low <= truth[name] <= estimate.high)
        share = extreme_droplet(sample)[0] or 1.0
        shares.append(share)
        low += share > MOST_EXTREME
    held_shares = {f"{name}_held": float(np.mean(flags)) if flags else None for name, flags in held.items()}
    return StatisticsRow(
        case=case.name,
        sprays=study.sprays,
        least_told=min(len(flags) for flags in held.values()) / study.sprays,
        extreme_share=float(np.median(shares)),
        low_samples=low / study.sprays,
        asked=case.asked,
        **held_shares,
    )


def _by_shot(sample: SpraySample) -> list[np.ndarray[tuple[int, ...], np.dtype[np.float64]]]:
    return [sample.diameters_um[sample.shot == shot] for shot in range(len(sample.volumes_mm3))]


def _estimates(sample: SpraySample) -> Mapping[str, Estimate | None]:
    sizes = mean_diameters(_by_shot(sample), confidence=CONFIDENCE)
    return {
        "d32": sizes.d32_um,
        "dv50": sizes.dv50_um,
        "span": sizes.relative_span,
        "flux": volume_flux(sample, AXIS, CONFIDENCE),
    }


def all_held(rows: Sequence[StatisticsRow]) -> bool | None:
    """Whether the intervals of all cases asked for hold the truth in 85 to 95 %; None where nothing is asked for."""
    asked = [held for row in rows if row.asked for held in _held(row)]
    return all(held is not None and LEAST_HELD <= held <= MOST_HELD for held in asked) if asked else None


def _held(row: StatisticsRow) -> list[float | None]:
    return [getattr(row, f"{name}_held") for name in FIGURES]


def _percent(held: float | None) -> str:
    return "-" if held is None else f"{100 * held:.1f}"


def statistics_line(row: StatisticsRow) -> str:
    """A case, for people."""
    held = ", ".join(f"{FIGURES[name]} {_percent(one)} %" for name, one in zip(FIGURES, _held(row), strict=True))
    return f"{row.case}: held by 90 % intervals: {held}; largest droplet {100 * row.extreme_share:.1f} % of the volume"


def statistics_statements(rows: Sequence[StatisticsRow]) -> list[Statement]:
    """Coverage of every case."""
    names = ", ".join(FIGURES.values())
    return [
        Statement(
            f"{row.case}: 90 % intervals of {names} that hold the truth, %",
            "left open, here asked for 85 to 95" if row.asked else "left open",
            f"{'/'.join(map(_percent, _held(row)))}; told in {100 * row.least_told:.0f} %; largest "
            f"droplet {100 * row.extreme_share:.1f} % of the volume, low sample by it in {100 * row.low_samples:.0f} %",
        )
        for row in rows
    ]


def statistics_figure(rows: Sequence[StatisticsRow]) -> Figure:
    """Coverage of all figures of every case."""
    cases = {row.case: dict(zip(FIGURES.values(), _held(row), strict=True)) for row in rows}
    return coverage_figure(cases, (LEAST_HELD, MOST_HELD))
