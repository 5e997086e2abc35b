"""Cameras, corners and drifts of a reduced rig stay within the limits that the study prints."""

from dataclasses import replace

import pytest

from processing.studies.accuracy_report import accuracy_figure, accuracy_line, accuracy_statements
from processing.studies.calibration_accuracy import (
    AccuracyRow,
    CalibrationStudy,
    calibration_study,
    of_quantity,
    tilted_cameras,
)

SMALL = CalibrationStudy(
    views=("view1", "view3"),
    z_mm=(-4.5, -2.5, -0.5, 1.0, 2.5, 4.5),
    binning=2,
    photographs=("sharp", "blur, noise and uneven light"),
    half_mm=(2.0, 1.5, 2.0),
    densities_per_mm3=(7.0,),
)


@pytest.fixture(scope="module")
def rows() -> list[AccuracyRow]:
    return list(calibration_study(SMALL))


def test_cameras_are_true_to_a_hundredth_of_a_pixel(rows: list[AccuracyRow]) -> None:
    found = of_quantity(rows, "true error")
    assert [(row.case, row.view) for row in found] == [
        (model, f"view{number}") for model in ("pinhole", "pinhole_tilted") for number in (1, 3)
    ]
    for row in found:
        assert row.kept
        assert row.value is not None
        assert row.maximum is not None
        assert 0.0005 < row.value < row.limit == 0.01
        assert row.maximum < 0.05


def test_corners_are_found_better_and_faster_than_the_limits(rows: list[AccuracyRow]) -> None:
    found = of_quantity(rows, "corner error")
    assert len(found) == len(of_quantity(rows, "corner time")) == 4
    for row in found:
        assert row.kept
        assert row.value is not None
        assert 0.001 < row.value < 0.05
    assert all(row.value is not None and row.value < 1.0 for row in of_quantity(rows, "corner time"))


def test_drift_of_every_view_is_recovered(rows: list[AccuracyRow]) -> None:
    found = of_quantity(rows, "drift error")
    assert [row.view for row in found] == ["view1", "view3"]
    for row in found:
        assert row.kept
        assert row.maximum is not None
        assert row.maximum < 0.1


def test_statements_give_limit_paper_and_worst_view(rows: list[AccuracyRow]) -> None:
    statements = {statement.topic: statement for statement in accuracy_statements(rows)}
    assert list(statements)[:2] == ["true error, pinhole (limit 0.01 px)", "true error, pinhole_tilted (limit 0.01 px)"]
    assert statements["corner error, sharp (limit 0.05 px)"].paper == "0.1 px"
    worst = max(row.value or 0 for row in of_quantity(rows, "corner error") if row.case == "sharp")
    assert statements["corner error, sharp (limit 0.05 px)"].ours.startswith(f"{worst:.2g} px rms")
    titles = [axes.get_title(loc="left") for axes in accuracy_figure(rows).axes]
    assert [title.split(":")[0] for title in titles] == ["cameras", "corners", "corners", "self-calibration"]


def test_what_breaks_a_limit_says_so(rows: list[AccuracyRow]) -> None:
    broken = replace(rows[0], value=0.02, maximum=0.03, kept=False)
    assert accuracy_line(broken) == "true error, pinhole, view1: 0.02 px rms, 0.03 px at most: BEYOND THE LIMIT"
    refused = replace(of_quantity(rows, "drift error")[0], value=None, maximum=None, kept=False)
    (statement,) = accuracy_statements([refused])
    assert statement.ours == "refused in 1 of 1 views"
    assert accuracy_figure([refused]).axes


def test_the_optical_axis_is_off_and_the_sensor_tilted_as_scheimpflug_asks() -> None:
    view1, _, view3, _ = tilted_cameras(CalibrationStudy(), tilted=True).values()
    assert view1.camera_matrix[0, 2] == pytest.approx(799.5 + 250)
    assert view3.camera_matrix[0, 2] == pytest.approx(799.5 - 250)
    assert view1.tilt_rad[1] == pytest.approx(0.42, abs=0.01)
    assert view3.tilt_rad[1] < 0
    assert tilted_cameras(CalibrationStudy(), tilted=False)["view1"].tilt_rad == (0.0, 0.0)
