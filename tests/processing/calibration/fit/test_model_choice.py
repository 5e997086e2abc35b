"""The model is chosen by points that no fit has seen; the simplest one wins unless another is clearly better."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from processing.calibration.calibrate import calibrate
from processing.calibration.calibration import Model, ViewCalibration
from processing.calibration.calibration_file import load_calibration, save_calibration
from processing.calibration.errors import CalibrationError
from processing.calibration.fit.model_choice import holdout_by_model, simplest_that_holds
from processing.calibration.observation import PlaneObservation
from processing.geometry import PinholeCamera
from server.cli.calibrations.calibrate import view_errors
from tests.support.calibration_cases import calibration_set, paper_camera, seen_planes, true_errors_px

Z_MM = (-4.0, -2.0, 0.0, 2.0, 4.0)
STRONG = (2.0, 100.0, 0.002, -0.001, 0.0)


def tilted_camera() -> PinholeCamera:
    """A Scheimpflug adaptor behind a lens with strong distortion: the two do not commute."""
    return replace(paper_camera(45.0, distortion=STRONG), tilt_rad=(0.05, 0.2))


def through_wavy_glass(planes: tuple[PlaneObservation, ...]) -> tuple[PlaneObservation, ...]:
    """A window that no lens describes: a cubic shear of the image, 0.6 px at its edges."""
    return tuple(
        replace(
            plane, image_px=plane.image_px + 0.6 * np.array([[1.0, 0.0]]) * ((plane.image_px[:, 1:] - 600) / 600) ** 3
        )
        for plane in planes
    )


def chosen(planes: tuple[PlaneObservation, ...]) -> ViewCalibration:
    return calibrate(calibration_set(only=planes), model="auto").views["only"]


def test_a_pinhole_camera_is_one() -> None:
    view = chosen(seen_planes(paper_camera(), z_mm=Z_MM))
    assert view.model is Model.PINHOLE
    errors_px = view.candidates_holdout_error_px
    assert list(errors_px) == [Model.PINHOLE, Model.PINHOLE_TILTED, Model.POLYNOMIAL]
    assert view.holdout_error_px == pytest.approx(errors_px[Model.PINHOLE], rel=0.01)
    assert errors_px[Model.PINHOLE_TILTED] == pytest.approx(errors_px[Model.PINHOLE], rel=0.02)


def test_tilt_is_seen_behind_a_distorting_lens() -> None:
    camera = tilted_camera()
    view = chosen(seen_planes(camera, z_mm=Z_MM, columns=13, rows=11))
    assert view.model is Model.PINHOLE_TILTED
    assert true_errors_px(view.mapping, camera).mean() < 0.05


def test_what_no_camera_describes_gets_a_polynomial() -> None:
    view = chosen(through_wavy_glass(seen_planes(paper_camera(15.0), z_mm=Z_MM)))
    assert view.model is Model.POLYNOMIAL
    errors_px = view.candidates_holdout_error_px
    assert errors_px[Model.POLYNOMIAL] < 0.85 * errors_px[Model.PINHOLE_TILTED]


def test_wrong_corners_do_not_decide() -> None:
    planes = seen_planes(paper_camera(), z_mm=Z_MM)
    planes[1].image_px[:30] += 40.0
    view = chosen(planes)
    assert (view.model, view.n_rejected) == (Model.PINHOLE, 30)
    assert view.candidates_holdout_error_px[Model.PINHOLE] < 0.07


def test_a_model_that_the_planes_do_not_determine_is_no_candidate() -> None:
    view = chosen(seen_planes(paper_camera(), z_mm=(-3.0, 3.0)))
    assert list(view.candidates_holdout_error_px) == [Model.PINHOLE, Model.PINHOLE_TILTED]


def test_the_file_keeps_the_candidates(tmp_path: Path) -> None:
    written = calibrate(calibration_set(only=seen_planes(paper_camera(), z_mm=Z_MM, columns=15, rows=11)), model="auto")
    save_calibration(written, tmp_path / "auto.json")
    view = load_calibration(tmp_path / "auto.json").views["only"]
    assert view.candidates_holdout_error_px == written.views["only"].candidates_holdout_error_px
    told = view_errors(written)["views"]["only"]
    assert (told["model"], told["candidates_holdout_error_px"]) == (view.model, view.candidates_holdout_error_px)


def test_a_file_of_one_model_names_no_candidates(tmp_path: Path) -> None:
    save_calibration(calibrate(calibration_set(only=seen_planes(paper_camera(), z_mm=Z_MM))), tmp_path / "one.json")
    assert "candidates" not in (tmp_path / "one.json").read_text()


@pytest.mark.parametrize(
    ("tilted_px", "points", "model"),
    [(0.99, 5000, "pinhole"), (0.9, 5000, "pinhole_tilted"), (0.9, 10, "pinhole")],
)
def test_better_is_not_enough(tilted_px: float, points: int, model: str) -> None:
    """By 1 % it may be so by chance of the world, of ten points by chance of the points."""
    rng = np.random.default_rng(2)
    pinhole_px = rng.rayleigh(0.05, points)
    others_px = tilted_px * rng.permutation(pinhole_px)
    assert simplest_that_holds({Model.PINHOLE: pinhole_px, Model.PINHOLE_TILTED: others_px}) == model


def test_unknown_model_is_refused() -> None:
    with pytest.raises(ValueError, match="best"):
        calibrate(calibration_set(only=seen_planes(paper_camera(), z_mm=Z_MM)), model="best")


def test_points_for_no_model_are_refused() -> None:
    few = [plane.select(np.arange(len(plane)) < 2) for plane in seen_planes(paper_camera(), z_mm=(-2.0, 2.0))]
    with pytest.raises(CalibrationError, match="4 points for 15 parameters"):
        holdout_by_model(few, (1600, 1200))
