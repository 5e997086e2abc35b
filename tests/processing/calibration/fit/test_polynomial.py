"""Soloff's polynomial."""

import numpy as np
import pytest

from processing.calibration.errors import CalibrationError
from processing.calibration.fit.polynomial import fit_polynomial
from processing.calibration.observation import PlaneObservation, stacked
from processing.calibration.polynomial_mapping import EXPONENTS, PolynomialMapping
from tests.support.calibration_cases import paper_camera, seen_planes, true_errors_px, volume_points_mm


def test_it_is_of_third_order_in_x_and_y_and_of_second_in_z() -> None:
    assert len(EXPONENTS) == len(set(EXPONENTS)) == 19
    assert {(3, 0, 0), (0, 3, 0), (0, 0, 2), (2, 1, 0), (1, 0, 2)} <= set(EXPONENTS)
    assert (0, 0, 3) not in EXPONENTS


def test_a_polynomial_is_recovered_exactly() -> None:
    rng = np.random.default_rng(2)
    truth = PolynomialMapping(
        rng.normal(0, 50, (19, 2)), np.array([1.0, -2.0, 0.5]), np.array([9.0, 8.0, 4.0]), (80, 60)
    )
    points_mm = volume_points_mm(500)
    fitted, used = fit_polynomial(points_mm, truth.project(points_mm), (80, 60))
    assert used.all()
    assert fitted.image_size_px == (80, 60)
    unseen_mm = volume_points_mm(300, seed=11)
    np.testing.assert_allclose(fitted.project(unseen_mm), truth.project(unseen_mm), atol=1e-8)


def test_it_follows_a_camera_to_a_hundredth_of_a_pixel() -> None:
    camera = paper_camera()
    points_mm, image_px = stacked(seen_planes(camera))
    image_px[::50] += 30.0
    fitted, used = fit_polynomial(points_mm, image_px, camera.image_size_px)
    assert not used[::50].any()
    assert true_errors_px(fitted, camera).mean() < 0.01


@pytest.mark.parametrize(
    "planes",
    [
        seen_planes(paper_camera(), z_mm=(-2.0, 2.0)),
        seen_planes(paper_camera(), columns=3),
        seen_planes(paper_camera(), columns=3, rows=3, z_mm=(-1.0, 0.0, 1.0)),
    ],
    ids=["two planes", "three columns", "27 points"],
)
def test_points_that_do_not_determine_it_are_refused(planes: tuple[PlaneObservation, ...]) -> None:
    with pytest.raises(CalibrationError, match="do not determine a polynomial of 19 terms"):
        fit_polynomial(*stacked(planes), (1600, 1200))
