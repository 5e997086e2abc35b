"""Data sets that others recorded, with the figures that others found for them."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from daq.files.run_directory import RunReader
from processing.calibration.calibrate import calibrate
from processing.calibration.calibration import Calibration
from processing.calibration.errors import CalibrationError, TargetNotFound
from processing.calibration.observation import CalibrationSet, PlaneObservation, ViewObservations
from processing.calibration.sets.calibration_set import load_calibration_set
from processing.calibration.target.targets import Target, detect_target
from processing.image_file import read_image
from processing.runs.manifest.importing import import_manifest

pytestmark = pytest.mark.skipif(
    "TOMOSHADOW_DATA" not in os.environ, reason="TOMOSHADOW_DATA does not name a folder of foreign data sets"
)
MANIFESTS = Path(__file__).parents[3] / "manifests"


def imported(name: str, tmp_path: Path) -> Path:
    import_manifest(MANIFESTS / f"{name}.toml", tmp_path / "out")
    return tmp_path / "out"


def calibrated(out: Path, model: str = "pinhole") -> Calibration:
    return calibrate(load_calibration_set(out), model=model)


def test_fluidimage_dots_fit_to_a_few_hundredths_of_a_pixel(tmp_path: Path) -> None:
    out = imported("fluidimage_tomo_4cam_synth", tmp_path)
    calibration = calibrated(out)
    assert list(calibration.views) == ["cam0", "cam1", "cam2", "cam3"]
    assert calibration.notes == ()
    for view in calibration.views.values():
        assert view.mean_error_px <= 0.03
        assert view.holdout_error_px <= 0.03
        assert view.verdict == "good"
        assert [plane.z_mm for plane in view.planes] == [-6.0, -3.0, 0.0, 3.0, 6.0]
        assert getattr(view.mapping, "camera_matrix")[0, 0] == pytest.approx(15400, rel=0.01)  # noqa: B009
    with RunReader(out / "run") as run:
        shot = run.read_shot(0)
        assert run.header.polarity == "bright"
        assert {view: frames.frame_a.shape for view, frames in shot.views.items()} == dict.fromkeys(
            calibration.views, (500, 504)
        )


def test_opencv_boards_are_all_found_and_better_than_the_reference(tmp_path: Path) -> None:
    calibration = calibrated(imported("opencv_chessboard_stereo", tmp_path))
    for view in calibration.views.values():
        assert [plane.n_points for plane in view.planes] == [54] * 13
        assert view.rms_px < 0.25
        assert getattr(view.mapping, "camera_matrix")[0, 0] == pytest.approx(536, rel=0.01)  # noqa: B009
        assert view.intrinsics_only
    with pytest.raises(CalibrationError, match="left, right: boards stood in free poses"):
        calibration.require_world()


def test_opencv_reference_corners_give_the_reference_result() -> None:
    """The shipped figures come from windows of 23 px, which reach beyond the edge of small boards, in left02 most."""
    folder = Path(os.environ["TOMOSHADOW_DATA"]) / "opencv_chessboard_stereo"
    x, y = np.meshgrid(np.arange(9) * 25.0, np.arange(6) * 25.0)
    board_mm = np.column_stack([x.ravel(), y.ravel(), np.zeros(54)])
    boards = []
    for file in sorted(folder.glob("left*.jpg")):
        image = read_image(file)
        found, corners_px = cv2.findChessboardCorners(image, (9, 6))
        assert found
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 0.01)
        corners_px = cv2.cornerSubPix(image, corners_px, (11, 11), (-1, -1), criteria)
        boards.append(PlaneObservation(file.name, board_mm, corners_px.reshape(-1, 2).astype(float), free_pose=True))
    views = {"left": ViewObservations((640, 480), tuple(boards))}
    view = calibrate(CalibrationSet("reference", None, views)).views["left"]
    assert 0.35 < view.rms_px < 0.5
    assert view.worst_plane.name == "left02.jpg"
    assert view.worst_plane.rms_px == pytest.approx(1.18, rel=0.1)


def test_opencv_boards_of_another_size_are_refused() -> None:
    file = Path(os.environ["TOMOSHADOW_DATA"]) / "opencv_chessboard_stereo" / "left01.jpg"
    for columns, rows in ((9, 7), (10, 6), (8, 6), (9, 5)):
        target = Target(kind="checkerboard", columns=columns, rows=rows, pitch_mm=25.0)
        with pytest.raises(TargetNotFound, match="a grid of 9 x 6 points is seen"):
            detect_target(read_image(file), target)


def test_myptv_points_fit_as_well_as_elsewhere(tmp_path: Path) -> None:
    calibration = calibrated(imported("myptv_3cam_dotplate", tmp_path))
    rms_px = {name: view.rms_px for name, view in calibration.views.items()}
    assert rms_px == pytest.approx({"cam1": 0.219, "cam2": 0.490, "cam3": 0.518}, rel=0.2)
    assert calibration.z_range_mm == (-12.0, 0.0)
    for view in calibration.views.values():
        assert view.mapping.image_size_px == (1280, 1024)
        assert view.n_rejected < 0.05 * view.n_points


def test_openptv_hidden_dots_do_not_break_the_fit_and_refraction_shows(tmp_path: Path) -> None:
    calibration = calibrated(imported("openptv_test_cavity", tmp_path))
    found = {name: view.n_points + view.n_rejected for name, view in calibration.views.items()}
    assert found["cam1"] >= 41
    assert found["cam2"] >= 39
    assert min(found["cam3"], found["cam4"]) >= 66
    for view in calibration.views.values():
        assert view.rms_px < 1.5
        assert view.verdict != "good"
    worst = max(calibration.views.values(), key=lambda view: view.holdout_error_px)
    assert worst.verdict in ("warn", "refuse")
