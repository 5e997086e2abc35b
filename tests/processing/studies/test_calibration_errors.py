"""Cameras, corners and drifts of a reduced rig stay within the limits that the study prints."""

from dataclasses import replace

import pytest

from processing.studies.calibration_errors import (
    all_kept,
    calibration_figure,
    calibration_line,
    calibration_statements,
    calibration_study,
    over_ideal,
)
from processing.studies.calibration_rows import CalibrationRow, CalibrationStudy, of_quantity

SMALL = CalibrationStudy(
    views=("view1", "view3"),
    z_mm=(-4.5, -2.5, -0.5, 1.0, 2.5, 4.5),
    fits=2,
    binning=2,
    photographs=("sharp", "blur, noise and uneven light"),
    half_mm=(2.0, 1.5, 2.0),
    densities_per_mm3=(7.0,),
)


@pytest.fixture(scope="module")
def rows() -> list[CalibrationRow]:
    return list(calibration_study(SMALL))


def test_cameras_are_true_to_a_hundredth_of_a_pixel(rows: list[CalibrationRow]) -> None:
    found = of_quantity(rows, "true error")
    assert [(row.case, row.view) for row in found] == [
        (f"{model}, {region}", f"view{number}")
        for model in ("pinhole", "pinhole_tilted")
        for number in (1, 3)
        for region in ("within the target", "whole volume")
    ]
    for row in found:
        assert row.kept
        assert row.value is not None
        assert row.maximum is not None
        assert row.within is not None
        assert 0.0005 < row.value < row.limit == 0.01
        assert row.value < row.maximum < 0.1
        assert row.within > 0.9


def test_corners_are_found_better_and_faster_than_the_limits(rows: list[CalibrationRow]) -> None:
    found = of_quantity(rows, "corner error")
    assert len(found) == len(of_quantity(rows, "corner time")) == 4
    for row in found:
        assert row.kept
        assert row.value is not None
        assert 0.001 < row.value < 0.05
    assert all(row.value is not None and row.value < 1.0 for row in of_quantity(rows, "corner time"))


def test_drift_of_every_view_is_recovered(rows: list[CalibrationRow]) -> None:
    found = of_quantity(rows, "drift error")
    assert [row.view for row in found] == ["view1", "view3"]
    for row in found:
        assert row.kept
        assert row.maximum is not None
        assert row.maximum < 0.1


def test_any_shot_tells_whether_a_view_has_moved(rows: list[CalibrationRow]) -> None:
    found = of_quantity(rows, "disparity error")
    assert [(row.view, row.case.split(", ")[1]) for row in found] == [
        (view, case) for view in ("view1", "view3") for case in ("in place", "off by 0.4 px")
    ]
    for row in found:
        assert row.kept
        assert row.value is not None
        assert row.maximum is not None
        assert row.value < row.limit == pytest.approx(0.1)
        assert row.value < row.maximum < (0.3 if "in place" in row.case else 0.1)


def test_statements_give_limit_paper_and_worst_view(rows: list[CalibrationRow]) -> None:
    statements = {statement.topic: statement for statement in calibration_statements(rows)}
    assert list(statements)[:2] == [
        "true error, pinhole, within the target (limit 0.01 px)",
        "true error, pinhole, whole volume (limit 0.01 px)",
    ]
    assert "everywhere): rms within the limit" in statements["true error, pinhole, whole volume (limit 0.01 px)"].ours
    assert statements["corner error, sharp (limit 0.05 px)"].paper == "0.1 px"
    worst = max(row.value or 0 for row in of_quantity(rows, "corner error") if row.case == "sharp")
    assert statements["corner error, sharp (limit 0.05 px)"].ours.startswith(f"{worst:.2g} px rms")
    assert float(statements["rms of all fits, relative to that of the best unbiased fits"].ours) < 1.5
    titles = [axes.get_title(loc="left") for axes in calibration_figure(rows).axes]
    topics = [title.split(":")[0] for title in titles]
    assert topics == ["cameras", "corners", "corners", "watch", "self-calibration", ""]


def test_what_breaks_a_limit_says_so(rows: list[CalibrationRow]) -> None:
    broken = replace(of_quantity(rows, "corner error")[0], value=0.06, maximum=0.2, kept=False)
    assert calibration_line(broken) == "corner error, sharp, view1: 0.06 px rms, 0.2 px at most: rms BEYOND the limit"
    refused = replace(of_quantity(rows, "drift error")[0], value=None, maximum=None, kept=False)
    (statement,) = calibration_statements([refused])
    assert statement.ours == "refused in 1 of 1 views: largest error BEYOND the limit"
    assert calibration_figure([refused]).axes
    assert over_ideal([refused]) is None
    assert all_kept(rows)
    assert not all_kept([*rows, broken])
