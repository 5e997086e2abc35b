"""Calibration figures show the points that were found, where they are, and their errors at one scale."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.quiver import Quiver

from processing.calibration.calibrate import calibrate
from processing.calibration.observation import CalibrationSet, PlaneObservation
from processing.figures.calibration_figures import MAX_ARROWS, MAX_PLANES, error_vectors_figure, grid_figure
from tests.support.calibration_cases import calibration_set, paper_camera, seen_planes, volume_points_mm
from tests.support.drawing import collisions


@pytest.fixture(scope="module")
def seen() -> CalibrationSet:
    return calibration_set(left=seen_planes(paper_camera(45)), right=seen_planes(paper_camera(-45), z_mm=(-2, 0, 1, 2)))


@pytest.mark.parametrize("y_sign", [1, -1])
def test_grid_carries_world_coordinates_where_the_points_are(seen: CalibrationSet, y_sign: int) -> None:
    plane = seen.views["left"].planes[5]
    planes = {"left": replace(plane, points_mm=plane.points_mm.round(9) * (1, y_sign, 1))}
    figure = grid_figure({"left": np.zeros((1200, 1600), np.uint8)}, planes)
    (axes,) = figure.axes
    labels = {text.get_text(): text.xy for text in axes.texts if hasattr(text, "xy")}
    assert 20 <= len(labels) <= 60
    points = zip(planes["left"].points_mm.round().astype(int), planes["left"].image_px, strict=True)
    places_px = {f"{x_mm}, {y_mm}": place_px for (x_mm, y_mm, _), place_px in points}
    for label, place_px in labels.items():
        np.testing.assert_allclose(place_px, places_px[label])
    assert axes.get_title() == "left, z = 0.5 mm; x, y in mm"
    assert axes.get_ylim()[0] > axes.get_ylim()[1]
    assert collisions(figure) == []


def test_positions_are_told_as_a_person_would_say_them() -> None:
    nearly = calibration_set(left=seen_planes(paper_camera(45), z_mm=(-2.0004, -0.5007, 0.0, 1.9996)))
    figure = error_vectors_figure(nearly, calibrate(nearly))
    assert [axes.get_title().split("\n")[0] for axes in figure.axes] == [
        f"left, z = {z_mm} mm" for z_mm in ("-2", "-0.5", "0", "2")
    ]


def test_scattered_points_have_arrows_too() -> None:
    camera, points_mm = paper_camera(), volume_points_mm(60)
    scattered = calibration_set(only=(PlaneObservation("table", points_mm, camera.project(points_mm)),))
    figure = error_vectors_figure(scattered, calibrate(scattered))
    (arrows,) = [part for part in figure.axes[0].collections if isinstance(part, Quiver)]
    assert len(np.asarray(arrows.get_offsets())) == 60
    assert collisions(figure) == []


def test_four_sections_stand_two_by_two(seen: CalibrationSet) -> None:
    planes = {name: seen.views["left"].planes[5] for name in "abc"}
    figure = grid_figure({name: np.zeros((1200, 1600), np.uint8) for name in planes}, planes)
    assert [axes.get_title()[0] for axes in figure.axes] == ["a", "b", "c"]
    assert collisions(figure) == []


def test_arrows_are_the_errors_of_the_planes(seen: CalibrationSet) -> None:
    calibration = calibrate(seen)
    figure = error_vectors_figure(seen, calibration)
    arrows = [[part for part in axes.collections if isinstance(part, Quiver)] for axes in figure.axes]
    assert [len(part) for part in arrows] == [1] * MAX_PLANES + [1, 1, 1, 1, 0]
    plane, first = seen.views["left"].planes[0], arrows[0][0]
    errors_px = calibration.views["left"].mapping.project(plane.points_mm) - plane.image_px
    places_px = np.asarray(first.get_offsets())
    shown = np.linalg.norm(plane.image_px[None] - places_px[:, None], axis=2).argmin(axis=1)
    assert len(plane) / 5 < len(places_px) <= MAX_ARROWS
    np.testing.assert_allclose(plane.image_px[shown], places_px)
    np.testing.assert_allclose(np.column_stack([first.U, first.V]), errors_px[shown])
    assert len({part[0].scale for part in arrows if part}) == 1
    told = calibration.views["left"].planes[0]
    title = f"left, z = -4.5 mm\n{told.mean_error_px:.3f} px, {told.max_error_px:.2f} px at most"
    assert figure.axes[0].get_title() == title
    assert figure.axes[0].get_ylabel() == "row [px]"
    assert figure.axes[5].get_xlabel() == "column [px]"
    assert collisions(figure) == []
