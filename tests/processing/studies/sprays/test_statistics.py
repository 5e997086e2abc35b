"""The study of intervals, reduced; and its truth, against what it samples."""

from dataclasses import replace

import numpy as np
import pytest

from processing.studies.sprays.simulated_sprays import (
    BOX_MM3,
    SPEED_M_S,
    SPEED_PER_UM,
    SprayCase,
    sampled,
    true_figures,
)
from processing.studies.sprays.statistics import (
    CASES,
    StatisticsRow,
    StatisticsStudy,
    all_held,
    statistics_figure,
    statistics_line,
    statistics_statements,
    statistics_study,
)

SMALL = (SprayCase(5, 100, 0.2), SprayCase(5, 25, 0.6, asked=False))


@pytest.fixture(scope="module")
def rows() -> list[StatisticsRow]:
    return list(statistics_study(StatisticsStudy(cases=SMALL, sprays=60)))


def test_intervals_hold_the_truth_about_as_often_as_they_say(rows: list[StatisticsRow]) -> None:
    """Of 60 sprays 0.9 is 0.79 to 0.99, three standard deviations."""
    adequate, low = rows
    for name in ("d32_held", "dv50_held", "span_held", "flux_held"):
        assert 0.79 <= getattr(adequate, name) <= 0.99, statistics_line(adequate)
    assert (adequate.low_samples < 0.1, low.low_samples) == (True, 1)
    assert low.least_told < 0.1, "a span of few large droplets is not told"


def test_an_interval_that_holds_too_seldom_or_too_often_fails(rows: list[StatisticsRow]) -> None:
    good = replace(rows[0], d32_held=0.9, dv50_held=0.86, span_held=0.94, flux_held=0.9)
    assert all_held([good, rows[1]])
    assert not all_held([replace(good, d32_held=0.84)])
    assert not all_held([replace(good, flux_held=0.96)])
    assert not all_held([replace(good, span_held=None)])
    assert all_held([rows[1]]) is None


def test_statements_and_figure_name_every_case(rows: list[StatisticsRow]) -> None:
    asked, open_case = statistics_statements(rows)
    assert asked.topic.startswith(SMALL[0].name)
    assert "asked for 85 to 95" in asked.paper
    assert open_case.paper == "left open"
    assert len(statistics_figure(rows).axes[0].lines) == 4
    assert len({case.name for case in CASES}) == len(CASES)


@pytest.mark.parametrize("case", [SprayCase(400, 400, 0.3), SprayCase(400, 400, 4.0, law="rosin-rammler")])
def test_the_truth_is_that_of_the_sampled_sprays(case: SprayCase) -> None:
    sample, truth = sampled(case, np.random.default_rng(0)), true_figures(case)
    d_um = np.sort(sample.diameters_um)
    volumes = np.cumsum(d_um**3) / np.sum(d_um**3)
    low, half, high = (d_um[np.searchsorted(volumes, share)] for share in (0.1, 0.5, 0.9))
    assert np.sum(d_um**3) / np.sum(d_um**2) == pytest.approx(truth["d32"], rel=0.01)
    assert half == pytest.approx(truth["dv50"], rel=0.01)
    assert (high - low) / half == pytest.approx(truth["span"], rel=0.02)
    carried = np.sum(d_um**3 * (SPEED_M_S + SPEED_PER_UM * d_um)) * np.pi / 6 * 1e-6 / (400 * BOX_MM3)
    assert carried == pytest.approx(truth["flux"], rel=0.04)
