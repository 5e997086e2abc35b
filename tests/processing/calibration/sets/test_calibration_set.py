"""From a recorded calibration run, and from tables of points, to observations."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from daq.files.run_directory import DoubleFrame, ExposureRecord, ImageKey, RunHeader, RunWriter, Shot, ViewFormat
from processing.calibration.calibrate import calibrate
from processing.calibration.errors import CalibrationError
from processing.calibration.fit.placement import placement
from processing.calibration.sets.calibration_set import load_calibration_set, write_set_file
from processing.calibration.sets.points_table import read_table
from processing.calibration.sets.set_record import CalibrationEntry, PointsEntry
from processing.synthetic.paper_rig import paper_cameras, paper_optics
from processing.synthetic.target import Checkerboard, render_target
from tests.support.calibration_cases import paper_camera, target_plane_mm, true_errors_px

BINNING = 4
VIEWS = ("view1", "view3")
Z_MM = (-4.0, -2.0, 0.0, 2.0, 4.0)
TARGET = {"kind": "checkerboard", "columns": 23, "rows": 17, "pitch_mm": 1.0}
Frame = NDArray[np.uint16]


@dataclass(frozen=True)
class Planned:
    """A shot of the target: where it stood, and what the shot is."""

    z_mm: float | None
    key: ImageKey = ImageKey.SAMPLE


def see(view: str, z_mm: float, seed: int, hanging: Sequence[str] = (), mirrored: Sequence[str] = ()) -> Frame:
    clear = render_target(paper_cameras(BINNING)[view], Checkerboard(), z_mm, paper_optics(BINNING)[view])
    upright = np.clip(np.random.default_rng(seed).normal(3000 * clear + 80, 20), 0, 4095).astype(np.uint16)
    turned = upright[::-1, ::-1] if view in hanging else upright
    return turned[:, ::-1] if view in mirrored else turned


def record(
    run_dir: Path,
    planned: list[Planned],
    configuration: dict[str, object],
    columns: slice = slice(None),
    hanging: Sequence[str] = (),
    mirrored: Sequence[str] = (),
) -> Path:
    """A run of these shots, of some columns of the images; exposures B, and shots that do not count, show nothing.

    Some cameras may hang upside down, or look by a mirror.
    """
    shape = see("view1", 0.0, 0)[:, columns].shape
    dark, fine = np.zeros(shape, np.uint16), ExposureRecord(valid=True, frame_id=1)
    header = RunHeader(
        run_id=run_dir.name,
        created_utc="2026-01-01T00:00:00+00:00",
        views=dict.fromkeys(VIEWS, ViewFormat(shape, 12)),
        configuration=configuration,
    )
    with RunWriter(run_dir, header) as writer:
        for index, shot in enumerate(planned):
            lit = shot.key is ImageKey.SAMPLE and shot.z_mm is not None
            frames = {
                view: see(view, shot.z_mm or 0.0, index, hanging, mirrored)[:, columns] if lit else dark
                for view in VIEWS
            }
            exposures = {view: DoubleFrame(frame, dark, fine, fine) for view, frame in frames.items()}
            writer.write_shot(Shot(index, shot.key, exposures, stage_z_mm=shot.z_mm))
        writer.finish("completed")
    return run_dir


def test_recorded_run_becomes_a_calibration(tmp_path: Path) -> None:
    planned = [Planned(z_mm) for z_mm in Z_MM for _ in range(2)]
    planned += [Planned(1.0, ImageKey.INVALID), Planned(3.0, ImageKey.DARK), Planned(None)]
    calibration_set = load_calibration_set(record(tmp_path / "target_run", planned, {"target": TARGET}))
    assert calibration_set.source == "target_run"
    assert calibration_set.notes == ()
    for view in VIEWS:
        assert [plane.z_mm for plane in calibration_set.views[view].planes] == list(Z_MM)
        assert all(len(plane) == 23 * 17 for plane in calibration_set.views[view].planes)
    calibration = calibrate(calibration_set)
    for view in VIEWS:
        assert true_errors_px(calibration.views[view].mapping, paper_cameras(BINNING)[view]).mean() < 0.02
        assert calibration.views[view].verdict == "good"


def test_a_camera_that_hangs_upside_down_must_be_said_to(tmp_path: Path) -> None:
    views = {"view1": {"azimuth_deg": 45.0}, "view3": {"azimuth_deg": -15.0}}
    planned = [Planned(z_mm) for z_mm in Z_MM]
    run_dir = record(tmp_path / "run", planned, {"target": TARGET, "views": views}, hanging=["view3"])
    with pytest.raises(CalibrationError, match=r"^view3: stands at 1\S+ deg .* Say --roll view3=180"):
        calibrate(load_calibration_set(run_dir))
    hanging = views | {"view3": {"azimuth_deg": -15.0, "roll_deg": 180.0}}
    configured = record(tmp_path / "said", planned, {"target": TARGET, "views": hanging}, hanging=["view3"])
    for told in (load_calibration_set(run_dir, rolls_deg={"view3": 180.0}), load_calibration_set(configured)):
        calibration = calibrate(told)
        assert calibration.notes == ()
        stands = placement(calibration.views["view3"].mapping, np.zeros(3))
        assert stands.azimuth_deg == pytest.approx(-15.0, abs=0.5)
        assert abs(stands.roll_deg) == pytest.approx(180.0, abs=0.5)
    with pytest.raises(CalibrationError, match="a roll is stated for view9; views are view1, view3"):
        load_calibration_set(run_dir, rolls_deg={"view9": 180.0})


def test_a_camera_that_looks_by_a_mirror_must_be_said_to(tmp_path: Path) -> None:
    views = {"view1": {"azimuth_deg": 45.0}, "view3": {"azimuth_deg": -15.0}}
    planned = [Planned(z_mm) for z_mm in (-4.0, 0.0, 4.0)]
    run_dir = record(tmp_path / "run", planned, {"target": TARGET, "views": views}, mirrored=["view3"])
    with pytest.raises(CalibrationError, match=r"^view3: .* Does it look by a mirror\? Say --mirrored view3"):
        calibrate(load_calibration_set(run_dir))
    calibration = calibrate(load_calibration_set(run_dir, mirrored=["view3"]))
    assert {view.verdict for view in calibration.views.values()} == {"good"}
    stands = placement(calibration.views["view3"].mapping, np.zeros(3))
    assert (stands.azimuth_deg, stands.roll_deg) == pytest.approx((-15.0, 0.0), abs=0.5)
    with pytest.raises(CalibrationError, match="a mirror is stated for view9; views are view1, view3"):
        load_calibration_set(run_dir, mirrored=["view9"])


def test_position_without_target_is_left_out_and_noted(tmp_path: Path) -> None:
    run_dir = record(tmp_path / "run", [Planned(z_mm) for z_mm in (-2.0, 2.0)], {"target": TARGET | {"columns": 24}})
    with pytest.raises(CalibrationError, match=r"run: view1 never sees the target; view1, z -2 mm left out: checkerb"):
        load_calibration_set(run_dir)


@pytest.mark.parametrize(
    ("configuration", "planned", "complaint"),
    [
        ({}, [Planned(0.0)], r"configuration\.target: the run does not say"),
        ({"target": {"kind": "checkerboard"}}, [Planned(0.0)], r"configuration\.target: "),
        ({"target": TARGET}, [Planned(None)], "no valid shot has a stage position"),
    ],
)
def test_runs_that_show_no_target_are_refused(
    tmp_path: Path, configuration: dict[str, object], planned: list[Planned], complaint: str
) -> None:
    with pytest.raises(CalibrationError, match=complaint):
        load_calibration_set(record(tmp_path / "run", planned, configuration))


def test_other_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match=r"neither a calibration run \(run\.h5\) nor a calibration set"):
        load_calibration_set(tmp_path)


def test_damaged_set_file_is_refused_by_field(tmp_path: Path) -> None:
    (tmp_path / "set.json").write_text('{"schema": "tomoshadow.calibration_set", "source": "x", "calibration": {}}')
    with pytest.raises(CalibrationError, match=r"set\.json: calibration: .*neither planes nor points"):
        load_calibration_set(tmp_path)
    (tmp_path / "set.json").write_bytes(b"\xff")
    with pytest.raises(CalibrationError, match=r"set\.json: text: Invalid JSON"):
        load_calibration_set(tmp_path)


def test_measured_points_are_split_by_level(tmp_path: Path) -> None:
    camera = paper_camera(15.0)
    world_mm = np.concatenate([target_plane_mm(z_mm) for z_mm in (-2.0, 0.0, 3.0)])
    np.savetxt(tmp_path / "points.txt", np.column_stack([camera.project(world_mm), world_mm]), header="u v x y z")
    entry = PointsEntry(
        camera="only", file="points.txt", columns=("u_px", "v_px", "x_mm", "y_mm", "z_mm"), image_size_px=(1600, 1200)
    )
    write_set_file(tmp_path, "table", CalibrationEntry(points=(entry,)))
    seen = load_calibration_set(tmp_path).views["only"]
    assert [plane.z_mm for plane in seen.planes] == [-2.0, 0.0, 3.0]
    assert seen.image_size_px == (1600, 1200)
    calibration = calibrate(load_calibration_set(tmp_path))
    assert true_errors_px(calibration.views["only"].mapping, camera).max() < 1e-3


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("1 2 3\n4 5\n", "line 2: 2 values, columns are u_px, v_px, x_mm"),
        ("1 2 3\n\n4 five 6\n", "line 3: five: not a number"),
        ("u v x\n1 2 3\n", "line 1: 'u v x': a header line"),
        ("1,5;2,5;3,5\n", "line 1: .*: decimal commas"),
        ("1,5,2,5,3,5\n", "line 1: .*: decimal commas"),
        ("1\0 2 3", "not a table in plain text"),
        ("1 2 3\n4 5 nan\n", "line 2: 4, 5, nan: values must be finite"),
        ("1 2 3\n-inf 5 6\n", "line 2: -inf, 5, 6: values must be finite"),
        ("1 2 3\n1_0 5 6\n", "line 2: 1_0: not a number"),
        ("1 2 3\n4 \u0665 6\n", "line 2: \u0665: not a number"),
        ("# nothing\n", "no points in it"),
    ],
)
def test_tables_are_refused_by_line(tmp_path: Path, text: str, complaint: str) -> None:
    (tmp_path / "t.txt").write_text(text)
    with pytest.raises(CalibrationError, match=complaint):
        read_table(tmp_path / "t.txt", ("u_px", "v_px", "x_mm"))


def test_tables_may_be_separated_by_anything(tmp_path: Path) -> None:
    (tmp_path / "t.txt").write_bytes("\ufeff1,2\n".encode() + "3;\t4 # µm\n".encode("latin-1"))
    table = read_table(tmp_path / "t.txt", ("x_mm", "y_mm"))
    np.testing.assert_array_equal(table["y_mm"], [2.0, 4.0])
