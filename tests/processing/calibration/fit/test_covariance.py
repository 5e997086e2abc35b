"""The covariance of a fit predicts how far repeated fits scatter, in every parameter and in the image."""

import json
from pathlib import Path

import numpy as np
import pytest

from processing.calibration.calibrate import calibrate
from processing.calibration.calibration import Calibration, ViewCalibration
from processing.calibration.calibration_file import load_calibration, save_calibration
from processing.calibration.errors import CalibrationError
from processing.calibration.fit.covariance import position_std_px, worst_position_std_px
from processing.calibration.fit.pinhole_fit import fit_pinhole
from processing.calibration.fit.polynomial import fit_polynomial
from processing.calibration.observation import PlaneObservation, stacked
from processing.geometry import PinholeCamera
from tests.processing.calibration.droplets.test_self_calibration import recalibrate, shifted
from tests.support.calibration_cases import calibration_set, paper_camera, seen_planes

REPEATS = 25
Z_MM = (-4.0, -2.0, 0.0, 2.0, 4.0)


def planes(seed: int = 0) -> tuple[PlaneObservation, ...]:
    return seen_planes(paper_camera(), z_mm=Z_MM, noise_px=0.05, seed=seed)


def calibrated(model: str = "pinhole") -> Calibration:
    return calibrate(calibration_set(only=planes()), model=model)


@pytest.fixture(scope="module")
def view() -> ViewCalibration:
    return calibrated().views["only"]


@pytest.fixture(scope="module")
def repeats() -> list[PinholeCamera]:
    return [fit_pinhole(*stacked(planes(seed)), (1600, 1200)).camera for seed in range(REPEATS)]


def test_parameters_scatter_as_predicted(view: ViewCalibration, repeats: list[PinholeCamera]) -> None:
    found = np.array([[*camera.translation_mm[:2], *camera.camera_matrix[:2, 2]] for camera in repeats])
    assert view.covariance is not None
    names = ("translation_x_mm", "translation_y_mm", "centre_u_px", "centre_v_px")
    predicted = [view.covariance.std[name] for name in names]
    np.testing.assert_allclose(found.std(axis=0), predicted, rtol=0.45)


def test_image_points_scatter_as_predicted(view: ViewCalibration, repeats: list[PinholeCamera]) -> None:
    points_mm = np.random.default_rng(5).uniform([-8, -6, -4], [8, 6, 4], (50, 3))
    seen_px = np.array([camera.project(points_mm) for camera in repeats])
    scatter_px = np.sqrt(seen_px.var(axis=0, ddof=1).sum(axis=1))
    predicted_px = position_std_px(view, points_mm)
    assert predicted_px is not None
    np.testing.assert_allclose(np.median(scatter_px / predicted_px), 1.0, atol=0.2)
    worst_px = worst_position_std_px(view)
    assert worst_px is not None
    assert predicted_px.max() < worst_px < 0.1


def test_tilted_camera_has_two_parameters_more() -> None:
    covariance = calibrated("pinhole_tilted").views["only"].covariance
    assert covariance is not None
    assert covariance.parameters[-2:] == ("tilt_x_rad", "tilt_y_rad")
    assert covariance.root.shape == (17, 17)


def test_coefficients_of_a_polynomial_scatter_as_predicted() -> None:
    view = calibrated("polynomial").views["only"]
    points_mm = np.random.default_rng(5).uniform([-8, -6, -4], [8, 6, 4], (50, 3))
    fits = [fit_polynomial(*stacked(planes(seed)), (1600, 1200))[0] for seed in range(REPEATS)]
    assert view.covariance is not None
    assert view.covariance.parameters[:2] == ("u_x0_y0_z0_px", "u_x1_y0_z0_px")
    std_px = np.array(list(view.covariance.std.values())).reshape(2, -1).T
    found_px = np.std([fit.coefficients for fit in fits], axis=0, ddof=1)
    np.testing.assert_allclose(np.median(found_px / std_px, axis=0), 1.0, atol=0.2)
    scatter_px = np.sqrt(np.var([fit.project(points_mm) for fit in fits], axis=0, ddof=1).sum(axis=1))
    predicted_px = position_std_px(view, points_mm)
    assert predicted_px is not None
    np.testing.assert_allclose(np.median(scatter_px / predicted_px), 1.0, atol=0.2)


def test_what_is_not_known_is_not_told() -> None:
    corrected = recalibrate({0: shifted(2.0, 0.0)}).calibration.views["view1"]
    assert corrected.covariance is None
    assert position_std_px(corrected, np.zeros((1, 3))) is None
    assert worst_position_std_px(corrected) is None


def test_file_keeps_it(tmp_path: Path) -> None:
    written = calibrated()
    path = tmp_path / "c.json"
    save_calibration(written, path)
    read, before = load_calibration(path).views["only"].covariance, written.views["only"].covariance
    assert read is not None
    assert before is not None
    assert read.parameters == before.parameters
    np.testing.assert_array_equal(read.root, before.root)
    content = json.loads(path.read_text())
    del content["views"]["only"]["covariance"]["root"][3][2]
    path.write_text(json.dumps(content))
    with pytest.raises(CalibrationError, match=r"views\.only\.covariance\.root: .*one row and one column"):
        load_calibration(path)
