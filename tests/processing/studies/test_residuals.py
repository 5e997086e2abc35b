"""Residuals of a binned view: detection limits them, the fit itself does not."""

import pytest

from processing.studies.residuals import (
    PointSource,
    ResidualRow,
    ResidualStudy,
    residual_figure,
    residual_statements,
    residual_study,
)

SMALL = ResidualStudy(binning=2, views=("view2",), z_mm=(-4.5, -2.0, 0.0, 2.0, 4.5))


@pytest.fixture(scope="module")
def rows() -> list[ResidualRow]:
    return list(residual_study(SMALL))


def curve(rows: list[ResidualRow], points: PointSource) -> list[ResidualRow]:
    return [row for row in rows if row.points == points]


def test_every_plane_of_detected_corners_is_better_than_the_papers(rows: list[ResidualRow]) -> None:
    detected = curve(rows, PointSource.DETECTED)
    assert [row.z_mm for row in detected] == list(SMALL.z_mm)
    for row in detected:
        assert 0.001 < row.mean_error_px < 0.05
        assert row.rms_px >= row.mean_error_px
        assert row.holdout_error_px is not None
        assert row.max_error_px is not None
        assert row.holdout_error_px < 0.05
        assert row.view_holdout_error_px < 0.05
        assert row.rms_px < row.max_error_px
        assert row.n_points > 0.97 * SMALL.columns * SMALL.rows


def test_nothing_is_left_of_ideal_points(rows: list[ResidualRow]) -> None:
    for row in curve(rows, PointSource.IDEAL):
        assert row.mean_error_px < 1e-6
        assert row.n_points == SMALL.columns * SMALL.rows


def test_statements_and_figure_name_view_and_limit(rows: list[ResidualRow]) -> None:
    detected, ideal = residual_statements(rows)
    assert detected.topic.startswith("view2, detected")
    assert ideal.topic.startswith("view2, ideal")
    assert detected.paper == "< 0.05 px"
    axes = residual_figure(rows).axes[0]
    legend = axes.get_legend()
    assert legend is not None
    labels = [text.get_text() for text in legend.get_texts()]
    assert labels == ["view2, corners detected in images", "all views, ideal points"]
    assert axes.get_ylabel().endswith("[px]")


def test_the_defaults_are_the_papers() -> None:
    study = ResidualStudy()
    assert len(study.z_mm) == 10
    assert study.z_mm[1] - study.z_mm[0] == pytest.approx(1.0)
    assert (study.target.columns, study.target.rows, study.target.pitch_mm) == (23, 17, 1.0)
