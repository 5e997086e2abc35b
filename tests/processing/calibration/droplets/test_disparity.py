"""The disparity of a shot is the drift of the view that moved, found among many false combinations."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from processing.calibration.calibration import Model
from processing.calibration.droplets.disparity import local_disparities, measured_box, shot_disparity
from processing.calibration.droplets.droplet_images import find_droplets
from processing.calibration.droplets.droplet_matching import Box, Matches, match_droplets
from processing.calibration.errors import CalibrationError, OutOfRange
from processing.calibration.triangulation import back_project, steepest_axis, triangulate
from processing.studies.seen_droplets import droplet_image
from tests.support.drifting_views import HALF_MM, calibration_of, droplet_shots, inside_mm, views

BOX = Box((-2.5, -2.0, -1.5), (2.5, 2.0, 1.5))


def test_box_is_the_calibrated_volume() -> None:
    assert measured_box(calibration_of(views(), Model.PINHOLE)) == BOX


def test_droplets_are_found_where_they_are() -> None:
    camera, points_mm = views()[0], inside_mm(40)
    true_px = camera.project(points_mm)
    found_px = find_droplets(droplet_image(camera, points_mm, np.random.default_rng(0)))
    distance_px = np.linalg.norm(found_px[:, None] - true_px, axis=2).min(axis=1)
    assert len(found_px) >= 36
    assert np.median(distance_px) < 0.1


def test_wide_and_long_spots_are_no_droplets() -> None:
    row, column = np.mgrid[:60, :160]
    image = np.exp(-((column - 30) ** 2 + (row - 30) ** 2) / (2 * 8.0**2))
    image += np.exp(-((column - 80) ** 2 / (2 * 3.5**2) + (row - 30) ** 2 / (2 * 1.2**2)))
    image += np.exp(-((column - 130.3) ** 2 + (row - 29.8) ** 2) / (2 * 1.5**2))
    np.testing.assert_allclose(find_droplets(image.astype(np.float32)), [[130.3, 29.8]], atol=0.02)


def test_an_empty_image_has_no_droplets() -> None:
    assert find_droplets(np.zeros((50, 60), np.float32)).shape == (0, 2)


@given(
    x=st.floats(-2.5, 2.5),
    y=st.floats(-2.0, 2.0),
    z=st.floats(-1.5, 1.5),
    azimuth_deg=st.sampled_from([45, 15, -45, 90, 180, -120]),
)
@settings(max_examples=25)
def test_lines_of_sight_lead_back_to_the_point(x: float, y: float, z: float, azimuth_deg: float) -> None:
    (camera,) = views([azimuth_deg])
    point_mm = np.array([[x, y, z]])
    axis = steepest_axis(camera, np.zeros(3))
    found_mm = back_project(camera, camera.project(point_mm), np.zeros(3), axis, float(point_mm[0, axis]))
    np.testing.assert_allclose(found_mm, point_mm, atol=1e-6)


def test_triangulation_inverts_projection() -> None:
    points_mm, cameras = inside_mm(100), views()
    seen_px = np.stack([camera.project(points_mm) for camera in cameras], axis=1)
    found_mm, left_px = triangulate(cameras, seen_px, np.zeros_like(points_mm))
    np.testing.assert_allclose(found_mm, points_mm, atol=1e-5)
    assert np.abs(left_px).max() < 1e-3


def test_views_in_one_place_leave_points_where_they_are_along_the_line_of_sight() -> None:
    points_mm, (camera,) = inside_mm(20), views([15])
    seen_px = np.stack([camera.project(points_mm)] * 2, axis=1)
    found_mm, left_px = triangulate([camera, camera], seen_px, points_mm)
    np.testing.assert_allclose(found_mm, points_mm, atol=1e-6)
    assert np.abs(left_px).max() < 1e-6


@pytest.mark.parametrize("azimuths_deg", [(45.0, 15.0, -15.0, -45.0), (90.0, -90.0, 0.0, 180.0), (90.0, 60.0, 120.0)])
def test_every_droplet_that_all_views_see_is_matched(azimuths_deg: tuple[float, ...]) -> None:
    points_mm, cameras = inside_mm(30), views(azimuths_deg)
    seen_px = [camera.project(points_mm) for camera in cameras]
    matches = match_droplets(cameras, seen_px, BOX, 2.0)
    distance_mm = np.linalg.norm(matches.points_mm[:, None] - points_mm, axis=2).min(axis=0)
    assert distance_mm.max() < 1e-4
    assert np.abs(matches.disparities_px).max() < 2.0


def test_peak_is_found_in_a_cloud_of_false_matches() -> None:
    rng = np.random.default_rng(4)
    cameras, true_px = views(), rng.uniform(-1, 1, (4, 2))
    cloud = rng.uniform(-4, 4, (3000, 4, 2))
    peak = true_px + rng.normal(0, 0.08, (40, 4, 2))
    matches = Matches(rng.uniform(-1, 1, (3040, 3)), np.concatenate([cloud, peak]))
    (found,) = local_disparities(cameras, matches, BOX, (1, 1, 1))
    np.testing.assert_allclose(found.disparity_px, true_px, atol=0.06)
    assert found.n_droplets == pytest.approx(40, abs=8)
    np.testing.assert_allclose(found.scatter_px, 0.08, atol=0.03)
    assert local_disparities(cameras, Matches(matches.points_mm[:3000], cloud), BOX, (1, 1, 1)) == []


def test_groups_of_false_matches_are_no_peak() -> None:
    rng = np.random.default_rng(4)
    groups = rng.uniform(-3, 3, (6, 1, 4, 2)) + rng.normal(0, 0.05, (6, 16, 4, 2))
    joint_px = np.concatenate([rng.uniform(-4, 4, (3000, 4, 2)), groups.reshape(-1, 4, 2)])
    matches = Matches(rng.uniform(-1, 1, (len(joint_px), 3)), joint_px)
    assert local_disparities(views(), matches, BOX, (1, 1, 1)) == []


def test_a_peak_at_the_edge_of_the_search_range_is_no_figure() -> None:
    droplets_px = list(droplet_shots(4)[0])
    droplets_px[1] = droplets_px[1] + 5.2 * np.array([0.6, 0.8])
    with pytest.raises(OutOfRange, match="at the edge of what is searched, 4 px"):
        shot_disparity(views(), [droplets_px], BOX)


@pytest.mark.parametrize("view", range(4))
def test_disparity_of_a_shot_is_the_drift(view: int) -> None:
    droplets_px = list(droplet_shots(4)[0])
    droplets_px[view] = droplets_px[view] + (0.5, 0.0)
    measured = shot_disparity(views(), [droplets_px], BOX)
    assert measured[view].disparity_px == pytest.approx(0.5, abs=0.08)
    assert 0.001 < measured[view].uncertainty_px < 0.08


def test_disparity_of_a_good_calibration_is_small() -> None:
    measured = shot_disparity(views(), droplet_shots(4)[:2], BOX)
    assert max(view.disparity_px for view in measured) < 0.15


def test_shots_without_droplets_cannot_be_checked() -> None:
    with pytest.raises(CalibrationError, match=r"the views see 0, 0, 0, 0 droplets, of which no 12 agree within 4 px"):
        shot_disparity(views(), [[np.empty((0, 2))] * 4], BOX)


def test_sub_volumes_divide_the_box() -> None:
    cells = BOX.cells(np.array([[-2.5, -2.0, -1.5], [2.5, 2.0, 1.5], [0.1, 0.1, 0.1], [-0.1, 0.1, 0.1]]), (2, 2, 2))
    assert cells.tolist() == [0, 7, 7, 3]
    assert BOX.contains(np.array([[0.0, 0.0, 0.0], [0.0, 2.1, 0.0]])).tolist() == [True, False]
    np.testing.assert_allclose(BOX.middle_mm, 0 * HALF_MM)
