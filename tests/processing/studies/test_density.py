"""The density study, reduced: the paper's trends, reproducible, drawn and written."""

import csv
import io

import numpy as np
import pytest

from processing.studies.density import (
    DensityRow,
    DensityStudy,
    density_figure,
    density_statements,
    density_study,
    limiting_density_per_mm3,
)
from processing.studies.recipe import LINE_OF_SIGHT, Recipe
from processing.studies.report import csv_text

SMALL = DensityStudy(
    shape=(64, 128, 128),
    counts=(64, 512, 2500),
    image_size_px=(192, 156),
    recipes=(*LINE_OF_SIGHT, Recipe.named("smart-8")),
)
"""A quarter of the paper's depth, so four times its densities for images as crowded as its."""


@pytest.fixture(scope="module")
def rows() -> list[DensityRow]:
    return list(density_study(SMALL))


def quality(rows: list[DensityRow], method: str) -> list[float]:
    return [row.quality_factor for row in rows if row.method == method]


def test_quality_falls_with_density(rows: list[DensityRow]) -> None:
    for recipe in SMALL.recipes:
        assert (np.diff(quality(rows, recipe.name)) < 0).all()


def test_smart_is_best_and_mlos_the_best_line_of_sight_when_dense(rows: list[DensityRow]) -> None:
    for smart, *others in zip(*(quality(rows, m) for m in ("smart-8", "mlos", "minlos", "gavlos")), strict=True):
        assert smart > max(others)
    assert quality(rows, "mlos")[-1] > max(quality(rows, "minlos")[-1], quality(rows, "gavlos")[-1])


def test_density_is_per_cubic_millimetre(rows: list[DensityRow]) -> None:
    assert rows[0].density_per_mm3 == pytest.approx(64 / (64 * 128 * 128 / 60**3))
    assert DensityStudy().counts[0] / DensityStudy().grid.volume_mm3 == pytest.approx(3.456)


def test_the_same_study_gives_the_same_rows() -> None:
    study = DensityStudy(shape=(64, 64, 64), counts=(20,), image_size_px=(128, 96), recipes=LINE_OF_SIGHT)
    assert list(density_study(study)) == list(density_study(study))


def test_the_csv_has_every_row(rows: list[DensityRow]) -> None:
    read = list(csv.DictReader(io.StringIO(csv_text(rows))))
    assert list(read[0]) == ["density_per_mm3", "method", "quality_factor", "sigma_voxel"]
    assert [float(row["quality_factor"]) for row in read] == [row.quality_factor for row in rows]


def test_the_figure_has_a_curve_per_method_and_the_papers_statement(rows: list[DensityRow]) -> None:
    axes = density_figure(rows, SMALL).axes[0]
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["MLOS", "MINLOS", "GAVLOS", "SMART-8"]
    curve = axes.lines[0].get_xydata()
    np.testing.assert_allclose(np.asarray(curve)[:, 1], quality(rows, "mlos"))
    assert "20 droplets" in axes.texts[0].get_text()
    assert "1/mm" in axes.get_xlabel()


def test_the_papers_figure_is_reproduced() -> None:
    """The middle of Fig. 7 at full size: what an independent implementation found, within 0.04."""
    found = {
        row.method: row.quality_factor for row in density_study(DensityStudy(counts=(4000,), recipes=LINE_OF_SIGHT))
    }
    assert found == pytest.approx({"mlos": 0.64, "minlos": 0.56, "gavlos": 0.42}, abs=0.04)


def test_every_width_has_its_panel_and_its_statements() -> None:
    rows = [DensityRow(density, "mlos", 1 - density / 100, sigma) for density in (10, 40) for sigma in (1.0, 1.5, 2.0)]
    figure = density_figure(rows)
    assert [axes.get_title() for axes in figure.axes] == [
        rf"Gaussian droplets of $\sigma$ = {sigma} voxel" for sigma in ("1", "1.5", "2")
    ]
    assert len(density_statements(rows)) == 6


def test_the_limit_of_mlos_is_interpolated_and_stands_beside_the_papers() -> None:
    rows = [DensityRow(density, "mlos", quality, 1.5) for density, quality in ((10.0, 0.75), (40.0, 0.25))]
    assert limiting_density_per_mm3(rows, "mlos", 1.5) == pytest.approx(20.0)
    limit, best = density_statements(rows)
    assert (limit.paper, limit.ours) == ("about 20 droplets/mm3", "20 droplets/mm3")
    assert (best.paper, best.ours) == ("MLOS", "MLOS at 10, MLOS at 40")
    assert limiting_density_per_mm3(rows[:1], "mlos", 1.5) is None


def test_the_defaults_are_the_papers_and_what_the_command_does() -> None:
    study = DensityStudy()
    assert study.sigmas_voxel == (1.5,)
    names = ["mlos", "minlos", "gavlos", "smart-5", "smart-10", "smart", "mart-5"]
    assert [recipe.name for recipe in study.recipes] == names
