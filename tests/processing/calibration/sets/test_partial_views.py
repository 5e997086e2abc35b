"""Targets that are mounted as it came, half covered, or cut by the edge of the image."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.calibration.calibrate import calibrate
from processing.calibration.errors import CalibrationError, TargetNotFound
from processing.calibration.sets.calibration_set import load_calibration_set
from processing.calibration.sets.partial_views import detect_by_others
from processing.calibration.target.targets import Target, TargetPoints, detect_target
from processing.geometry import FloatArray, PinholeCamera
from processing.synthetic.paper_rig import paper_cameras, paper_optics
from processing.synthetic.stamping import FloatImage
from processing.synthetic.target import Checkerboard, DotTarget, render_target
from tests.processing.calibration.sets.test_calibration_set import BINNING, TARGET, VIEWS, Planned, record
from tests.support.calibration_cases import seen_planes, true_errors_px

PITCH_MM = 1.5
ORIGIN_ID = np.array([2, -1])
"""The node that carries the marker, or that somebody points at; counted from the middle of the board."""
TURN, MIRROR = np.array([[0, -1], [1, 0]]), np.array([[-1, 0], [0, 1]])
MOUNTINGS = [
    np.linalg.matrix_power(TURN, turns) @ flip for flip in (np.eye(2, dtype=int), MIRROR) for turns in range(4)
]
Z_MM = (-4.0, -2.0, 0.0, 2.0, 4.0)


@dataclass(frozen=True)
class Mounted:
    """A square target in one of its eight symmetries, a thin square around one of its dots."""

    pattern: Checkerboard | DotTarget
    mounting: NDArray[np.int64]
    marked: bool

    def transmittance(self, x_mm: FloatImage, y_mm: FloatImage) -> FloatImage:
        (a, b), (c, d) = self.mounting
        x, y = a * x_mm + b * y_mm, c * x_mm + d * y_mm
        clear = self.pattern.transmittance(x.astype(np.float32), y.astype(np.float32))
        u, v = (np.abs(one - PITCH_MM * place) for one, place in zip((x, y), ORIGIN_ID, strict=True))
        ring = np.abs(np.maximum(u, v) - 0.3 * PITCH_MM) < 0.06
        return np.where(ring & self.marked, np.float32(0.4), clear).astype(np.float32)


def photograph(camera: PinholeCamera, pattern: Mounted | Checkerboard, z_mm: float = 0.0) -> FloatImage:
    clear = render_target(camera, pattern, z_mm, paper_optics(BINNING)["view2"])
    return np.asarray(np.random.default_rng(1).normal(3000 * clear + 80, 12), dtype=np.float32)


def errors_px(points: TargetPoints, camera: PinholeCamera, origin_mm: FloatArray, z_mm: float = 0.0) -> FloatArray:
    plane_mm = points.ids * PITCH_MM + origin_mm
    true_px = camera.project(np.column_stack([plane_mm, np.full(len(points), z_mm)]))
    return np.asarray(np.linalg.norm(points.image_px - true_px, axis=1), dtype=np.float64)


@pytest.mark.parametrize("mounting", MOUNTINGS, ids=str)
@pytest.mark.parametrize("kind", ["dots", "checkerboard"])
def test_marker_or_stated_origin_tells_every_mounting(kind: str, mounting: NDArray[np.int64]) -> None:
    camera = paper_cameras(BINNING)["view2"]
    marked = kind == "dots"
    pattern = DotTarget(9, 9, PITCH_MM, 0.3) if marked else Checkerboard(9, 9, PITCH_MM)
    image = photograph(camera, Mounted(pattern, mounting, marked))
    origin_mm = np.linalg.inv(mounting) @ ORIGIN_ID * PITCH_MM
    u_px, v_px = camera.project(np.array([[*origin_mm, 0.0]]))[0]
    target = Target.model_validate({"kind": kind, "columns": 9, "rows": 9, "pitch_mm": PITCH_MM})
    points = detect_target(image, target, None if marked else (u_px + 6, v_px - 5))
    assert len(points) >= 78
    assert errors_px(points, camera, origin_mm).max() < 0.2


@pytest.mark.parametrize(("columns", "rows"), [(7, 7), (9, 8), (8, 12)])
@pytest.mark.parametrize("kind", ["dots", "checkerboard"])
def test_a_board_of_another_size_is_refused_though_its_origin_is_known(kind: str, columns: int, rows: int) -> None:
    camera = paper_cameras(BINNING)["view2"]
    marked = kind == "dots"
    pattern = DotTarget(9, 9, PITCH_MM, 0.3) if marked else Checkerboard(9, 9, PITCH_MM)
    image = photograph(camera, Mounted(pattern, MOUNTINGS[0], marked))
    u_px, v_px = camera.project(np.array([[*(ORIGIN_ID * PITCH_MM), 0.0]]))[0]
    target = Target.model_validate({"kind": kind, "columns": columns, "rows": rows, "pitch_mm": PITCH_MM})
    with pytest.raises(
        TargetNotFound, match=f"9 x 9 points is seen, not the whole board of {columns} x {rows}; it is la"
    ):
        detect_target(image, target, None if marked else (u_px, v_px))


def test_stray_points_beyond_the_board_are_left_out() -> None:
    camera = paper_cameras(BINNING)["view2"]
    image = photograph(camera, Mounted(DotTarget(9, 9, PITCH_MM, 0.3), MOUNTINGS[0], marked=True))
    inside, stray = camera.project(np.array([[4 * PITCH_MM, 0.0, 0.0], [5 * PITCH_MM, 0.0, 0.0]])).round().astype(int)
    around = np.mgrid[-6:7, -6:7]
    image[stray[1] + around[0], stray[0] + around[1]] = image[inside[1] + around[0], inside[0] + around[1]]
    points = detect_target(image, Target(kind="dots", columns=9, rows=9, pitch_mm=PITCH_MM))
    np.testing.assert_array_equal(np.ptp(points.ids, axis=0), [8, 8])
    assert len(points) == 81


def test_missing_corners_cost_themselves_only() -> None:
    camera = paper_cameras(BINNING)["view1"]
    image = photograph(camera, Checkerboard())
    image[120:165, 180:240] = 1500.0
    image[:80, :110] = 100.0
    points = detect_target(image, Target.model_validate(TARGET))
    error_px = np.linalg.norm(
        points.image_px - camera.project(np.column_stack([points.ids, 0 * points.ids[:, 0]])), axis=1
    )
    assert 0.75 * 391 < len(points) < 0.97 * 391
    assert np.quantile(error_px, 0.97) < 0.1
    assert error_px.max() < 1.0


def test_positions_with_the_whole_board_tell_the_others(tmp_path: Path) -> None:
    columns = slice(42, 390)
    run_dir = record(tmp_path / "run", [Planned(z_mm) for z_mm in Z_MM], {"target": TARGET}, columns)
    found = load_calibration_set(run_dir)
    assert len(found.views["view1"].planes) == len(Z_MM)
    assert any(note.startswith("view1, z 4 mm: ") and "other positions tell" in note for note in found.notes)
    calibration = calibrate(found)
    for view in VIEWS:
        camera = paper_cameras(BINNING)[view]
        cut = replace(camera, camera_matrix=camera.camera_matrix - np.diag([columns.start, 0, 0])[:, [1, 2, 0]])
        assert true_errors_px(calibration.views[view].mapping, cut).mean() < 0.03
        assert calibration.views[view].verdict == "good"


def test_where_no_position_shows_the_whole_board_two_origins_tell(tmp_path: Path) -> None:
    columns, ends_mm = slice(110, 400), (-4.0, 4.0)
    run_dir = record(tmp_path / "run", [Planned(z_mm) for z_mm in (*ends_mm, 0.0)], {"target": TARGET}, columns)
    with pytest.raises(CalibrationError, match=r"never sees the target.*say where the origin is seen at two positions"):
        load_calibration_set(run_dir)
    seen = {
        (view, z_mm): paper_cameras(BINNING)[view].project(np.array([[0.0, 0.0, z_mm]]))[0]
        for view in VIEWS
        for z_mm in ends_mm
    }
    found = load_calibration_set(run_dir, {place: (u - columns.start + 2, v - 2) for place, (u, v) in seen.items()})
    for view in VIEWS:
        camera = paper_cameras(BINNING)[view]
        for plane in found.views[view].planes:
            true_px = camera.project(plane.points_mm) - (columns.start, 0)
            assert np.median(np.linalg.norm(plane.image_px - true_px, axis=1)) < 0.1
        assert [plane.z_mm for plane in found.views[view].planes] == [-4.0, 0.0, 4.0]


def test_origins_of_views_and_positions_that_are_not_there_are_refused(tmp_path: Path) -> None:
    run_dir = record(tmp_path / "run", [Planned(0.0)], {"target": TARGET})
    with pytest.raises(
        CalibrationError, match=r"origin is stated for view9 at z 0 mm; views are view1, view3, positions 0"
    ):
        load_calibration_set(run_dir, {("view9", 0.0): (1.0, 2.0)})


def test_a_target_that_was_moved_sideways_in_between_is_left_out() -> None:
    camera, board = paper_cameras(BINNING)["view2"], Target.model_validate(TARGET)
    known = seen_planes(camera, z_mm=(-2.0, 2.0), noise_px=0.0)
    image = photograph(camera, Checkerboard())
    assert len(detect_by_others(image, board, 0.0, known)) == 391
    with pytest.raises(TargetNotFound, match=r"points lie \d+\.\d px beside where the other positions say"):
        detect_by_others(np.roll(image, 6, axis=1), board, 0.0, known)
    with pytest.raises(TargetNotFound, match="1 other positions are known, 2 would tell"):
        detect_by_others(image, board, 0.0, known[:1])
    with pytest.raises(TargetNotFound, match="lies outside the image"):
        detect_by_others(image, board, 300.0, known)
