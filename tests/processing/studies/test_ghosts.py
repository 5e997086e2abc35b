"""The ghost study, reduced: ghosts grow with density, SMART has the fewest, a rule without truth keeps up."""

import pytest

from processing.studies.ghosts import (
    GhostRow,
    GhostStudy,
    ThresholdRule,
    ghost_figure,
    ghost_statements,
    ghost_study,
    meets_target,
)
from processing.studies.recipe import PAPER_RECIPES, Recipe

SMALL = GhostStudy(shape=(250, 40, 300), counts=(83, 333, 666), recipes=PAPER_RECIPES, image_size_px=(440, 90))
"""Lines of sight as long as the paper's, densities of 6, 24 and 48 per mm^3; less along y, where no view looks."""


@pytest.fixture(scope="module")
def rows() -> list[GhostRow]:
    return list(ghost_study(SMALL))


def select(rows: list[GhostRow], method: str, rule: ThresholdRule) -> list[GhostRow]:
    return [row for row in rows if row.method == method and row.threshold_rule == rule]


@pytest.mark.parametrize("recipe", SMALL.recipes, ids=lambda recipe: recipe.name)
def test_ghosts_grow_with_density(rows: list[GhostRow], recipe: Recipe) -> None:
    ghosts = [row.ghosts for row in select(rows, recipe.name, ThresholdRule.BEST_WITH_TRUTH)]
    assert ghosts == sorted(ghosts)
    assert ghosts[-1] > ghosts[0]


@pytest.mark.parametrize("rule", ThresholdRule)
def test_smart_finds_what_the_paper_needs_at_24_droplets_per_cubic_millimetre(
    rows: list[GhostRow], rule: ThresholdRule
) -> None:
    dense = select(rows, "smart", rule)[1]
    assert dense.density_per_mm3 == pytest.approx(24, abs=0.1)
    assert dense.found >= 0.97
    assert dense.ghosts <= 0.02


def test_smart_has_fewer_ghosts_than_any_line_of_sight(rows: list[GhostRow]) -> None:
    smart = select(rows, "smart", ThresholdRule.BEST_WITH_TRUTH)[1]
    for method in ("mlos", "minlos", "gavlos"):
        other = select(rows, method, ThresholdRule.BEST_WITH_TRUTH)[1]
        assert other.ghosts > smart.ghosts + 0.05
        assert other.found < smart.found


def test_no_rule_beats_the_one_that_knows_the_truth(rows: list[GhostRow]) -> None:
    for recipe in SMALL.recipes:
        pairs = zip(*(select(rows, recipe.name, rule) for rule in ThresholdRule), strict=True)
        for blind, best in pairs:
            assert best.found - best.ghosts >= blind.found - blind.ghosts


def test_statements_say_up_to_which_density_a_method_holds() -> None:
    rows = [
        GhostRow(density, "smart", ThresholdRule.HALF_MEDIAN, 0.5, found, ghosts, 1.0)
        for density, found, ghosts in ((7.0, 1.0, 0.0), (14.0, 0.98, 0.019), (28.0, 0.96, 0.0), (56.0, 0.99, 0.0))
    ]
    with_rule, without_rows = ghost_statements(rows)
    assert with_rule.ours == "up to 14.0 droplets/mm3 (98.0 % found, 1.9 % ghosts)"
    assert with_rule.topic.startswith("SMART-20, half_median")
    assert without_rows.ours == "none of the simulated ones"


@pytest.mark.parametrize(
    ("points", "sigma_voxel", "expected"),
    [
        (((14, 0.99, 0.0), (27.6, 0.97, 0.02), (55, 0.5, 0.9)), 1.0, True),
        (((14, 0.99, 0.0), (27.6, 0.969, 0.0)), 1.0, False),
        (((14, 0.99, 0.021), (27.6, 0.99, 0.0)), 1.0, False),
        (((14, 0.99, 0.0), (27.6, 0.99, 0.0)), 1.5, None),
        (((7, 0.99, 0.0), (55, 0.99, 0.0)), 1.0, None),
    ],
)
def test_the_target_is_met_by_every_density_below_its_own_or_not_at_all(
    points: tuple[tuple[float, float, float], ...], sigma_voxel: float, expected: bool | None
) -> None:
    rows = [
        GhostRow(density, "smart", ThresholdRule.HALF_MEDIAN, 0.5, found, ghosts, sigma_voxel)
        for density, found, ghosts in points
    ]
    worthless = GhostRow(14, "mlos", ThresholdRule.HALF_MEDIAN, 0.5, 0.1, 0.9, sigma_voxel)
    assert meets_target([*rows, worthless]) is expected


def test_smart_meets_the_target_in_the_reduced_volume(rows: list[GhostRow]) -> None:
    assert meets_target(rows)


def test_the_figure_shows_both_quantities_for_both_rules(rows: list[GhostRow]) -> None:
    figure = ghost_figure(rows)
    assert [axes.get_ylabel() for axes in figure.axes] == ["found [% of the droplets]", "ghosts [% of the peaks]"] * 2
    assert all(len(axes.lines) == len(SMALL.recipes) + 1 for axes in figure.axes)
