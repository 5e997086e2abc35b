"""What a lab asks, reduced: errors and noise cost droplets, more and wider spread views bring fewer ghosts."""

import numpy as np
import pytest

from processing.studies.recipe import Recipe
from processing.studies.sensitivity import (
    Influence,
    SensitivityRow,
    SensitivityStudy,
    Setup,
    misaligned,
    noisy_image,
    sensitivity_figure,
    sensitivity_statements,
    sensitivity_study,
    setup_cameras,
)

SMALL = SensitivityStudy(
    shape=(250, 24, 250),
    recipes=(Recipe.named("smart-5"),),
    calibration_errors_px=(0.0, 0.5, 2.0),
    views=(2, 3, 5),
    yaw_spreads_deg=(15.0, 90.0),
    noises_percent=(0.0, 50.0),
    repeats=1,
    image_size_px=(400, 70),
)


@pytest.fixture(scope="module")
def rows() -> list[SensitivityRow]:
    return list(sensitivity_study(SMALL))


def rates(rows: list[SensitivityRow], influence: Influence) -> tuple[list[float], list[float]]:
    chosen = [row for row in rows if row.influence == influence]
    return [row.found for row in chosen], [row.ghosts for row in chosen]


def test_calibration_errors_make_ghosts_and_two_pixels_leave_nothing_to_trust(rows: list[SensitivityRow]) -> None:
    found, ghosts = rates(rows, Influence.CALIBRATION_ERROR)
    assert ghosts == sorted(ghosts)
    assert found[0] > 0.99
    assert ghosts[0] < 0.01
    assert found[1] > 0.95
    assert ghosts[-1] > 0.5


def test_more_views_bring_fewer_ghosts(rows: list[SensitivityRow]) -> None:
    _, ghosts = rates(rows, Influence.VIEWS)
    assert ghosts == sorted(ghosts, reverse=True)
    assert ghosts[0] > 0.3
    assert ghosts[-1] < 0.01


def test_views_too_close_together_cannot_tell_depth(rows: list[SensitivityRow]) -> None:
    found, ghosts = rates(rows, Influence.YAW_SPREAD)
    assert ghosts[0] > ghosts[1] + 0.05
    assert found[0] < found[1]


def test_noise_costs_droplets(rows: list[SensitivityRow]) -> None:
    found, ghosts = rates(rows, Influence.NOISE)
    assert found[1] - ghosts[1] < found[0] - ghosts[0] - 0.05


def test_the_paper_rig_is_what_setups_start_from() -> None:
    yaws_rad = [np.arcsin(camera.rotation[2, 0]) for camera in setup_cameras(Setup(), (640, 160))]
    np.testing.assert_allclose(np.rad2deg(yaws_rad), [-45, -15, 15, 45])


def test_a_misaligned_camera_is_wrong_by_its_error_everywhere() -> None:
    camera = setup_cameras(Setup(), (640, 160))[0]
    points_mm = np.random.default_rng(1).uniform(-2, 2, (20, 3))
    wrong = misaligned(camera, 1.5, np.random.default_rng(2))
    distances_px = np.linalg.norm(wrong.project(points_mm) - camera.project(points_mm), axis=1)
    np.testing.assert_allclose(distances_px, 1.5, rtol=1e-6)


def test_noise_is_relative_to_a_droplet_and_its_floor_is_cut_off() -> None:
    empty = np.zeros((200, 200), np.float32)
    noisy = noisy_image(empty, Setup(noise_percent=10), 1.0, np.random.default_rng(3))
    assert float(noisy.min()) == 0
    assert 0.01 < float(np.mean(noisy > 0)) < 0.04
    assert noisy_image(empty, Setup(), 1.0, np.random.default_rng(3)) is empty


def test_figure_and_statements_cover_every_influence(rows: list[SensitivityRow]) -> None:
    figure = sensitivity_figure(rows)
    assert len(figure.axes) == len(Influence)
    assert all(len(axes.lines) == 2 for axes in figure.axes)
    statements = sensitivity_statements(rows)
    assert len(statements) == len(Influence)
    assert "2: " in statements[0].ours


def test_values_reach_from_no_error_to_two_pixels_and_from_two_views_to_six() -> None:
    study = SensitivityStudy()
    assert (min(study.calibration_errors_px), max(study.calibration_errors_px)) == (0, 2)
    assert (min(study.views), max(study.views)) == (2, 6)
