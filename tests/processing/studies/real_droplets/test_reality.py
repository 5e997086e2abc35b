"""The study of p_real, reduced: shots with ghosts, so that there is something to tell."""

from dataclasses import replace

import pytest

from processing.studies.droplets import DropletCase
from processing.studies.real_droplets.reality import (
    TRIED,
    RealityRow,
    RealityStudy,
    all_true,
    reality_line,
    reality_of_rows,
    reality_statements,
    reality_study,
)
from processing.studies.shadows.sizes import SizeCase
from tests.support.fit_reality import CASES, SEEDS

SMALL = RealityStudy(
    cases=(DropletCase(50, noise_percent=20), SizeCase(34, noise_percent=4, aperture_ratio=0.6)),
    seeds=(401,),
    shape=(250, 24, 300),
)


@pytest.fixture(scope="module")
def rows() -> list[RealityRow]:
    return list(reality_study(SMALL))


@pytest.mark.parametrize("kind", ["bright", "shadows"])
def test_so_many_are_real_as_is_told(rows: list[RealityRow], kind: str) -> None:
    chosen = [row for row in rows if row.kind == kind]
    ghosts = sum(row.droplets - row.real for row in chosen)
    expected = sum(row.droplets * (1 - row.stated) for row in chosen)
    assert ghosts > 10
    assert expected == pytest.approx(ghosts, rel=0.6)
    sure = [row for row in chosen if row.least >= 0.9]
    unlikely = [row for row in chosen if row.most <= 0.5]
    assert sum(row.real for row in sure) > 0.96 * sum(row.droplets for row in sure)
    assert sum(row.real for row in unlikely) < 0.6 * sum(row.droplets for row in unlikely)


def row(least: float, most: float, droplets: int, stated: float, real: int) -> RealityRow:
    return RealityRow("bright", "case", 1, 1.0, "good", least, most, droplets, stated, real)


def test_what_is_told_must_be_true() -> None:
    told = [row(0.5, 0.7, 10, 0.6, 6), row(0.99, 1, 1000, 0.999, 999)]
    assert all_true(told)
    assert not all_true([replace(told[0], real=3), told[1]])
    assert not all_true([told[0], replace(told[1], real=980)])


def test_statements_and_figure_name_what_is_told_and_what_is_true(rows: list[RealityRow]) -> None:
    statements = {one.topic: one.ours for one in reality_statements(rows)}
    assert "stated" in statements["shadows: real of those told as 0.5 to 0.9"]
    assert statements["bright: ghosts"].endswith("expected")
    assert "true" in statements[f"bright, {SMALL.cases[0].name}: share of ghosts told"]
    assert [len(axes.lines) > 1 for axes in reality_of_rows(rows).axes] == [True, True]
    assert "are real" in reality_line(rows[0])


def test_no_case_was_fitted_to_that_is_tried() -> None:
    names = {case.name for cases in CASES.values() for case in cases}
    assert not names & {case.name for case in TRIED}
    assert not set(SEEDS) & set(RealityStudy().seeds)
