"""Manifests: images from elsewhere become runs and calibration sets, or nothing is written and the line is named."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from daq.files.run_directory import ImageKey, RunReader, Spray
from processing.calibration.calibrate import calibrate
from processing.calibration.errors import CalibrationError
from processing.calibration.sets.calibration_set import load_calibration_set
from processing.runs.manifest.import_manifest import ManifestError
from processing.runs.manifest.importing import import_manifest
from processing.runs.overwriting import OutputExistsError
from processing.synthetic.paper_rig import paper_cameras, paper_optics
from processing.synthetic.target import Checkerboard, render_target
from tests.support.calibration_cases import true_errors_px

SIZES = {"left": (24, 32), "right": (20, 40)}
Image = NDArray[np.uint8] | NDArray[np.uint16]


def image(camera: str, value: int) -> Image:
    """8 bits on the left, 16 that are in use on the right."""
    rows, columns = SIZES[camera]
    ramp = np.tile(np.arange(value, value + columns), (rows, 1))
    return ramp.astype(np.uint8) if camera == "left" else (800 * ramp).astype(np.uint16)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Images ``left_7.png`` of grey value 7 and so on."""
    for camera in SIZES:
        for value in (1, 2, 3, 4, 5, 6, 10, 20, 30, 40):
            cv2.imwrite(str(tmp_path / f"{camera}_{value}.png"), image(camera, value))
    return tmp_path


def frames(kind: str, value: int) -> str:
    return f'frame_{kind} = {{ left = "left_{value}.png", right = "right_{value}.png" }}\n'


RUN = f"""[run]
polarity = "shadow"
separation_ns = 6400
[[run.shot]]
{frames("a", 1)}{frames("b", 2)}
[[run.shot]]
{frames("a", 3)}{frames("b", 4)}"""
REFERENCES = f"""
[[run.background]]
{frames("a", 10)}{frames("b", 30)}
[[run.background]]
{frames("a", 20)}{frames("b", 40)}
[[run.dark]]
{frames("a", 5)}{frames("b", 6)}"""


BOARD = """[calibration]
target = { kind = "checkerboard", columns = 9, rows = 7, pitch_mm = 1 }
[[calibration.plane]]
z_mm = 1.0
images = { left = "left_1.png" }
"""


def run_import(folder: Path, text: str) -> Path:
    (folder / "manifest.toml").write_text(text)
    import_manifest(folder / "manifest.toml", folder / "out")
    return folder / "out"


def test_copied_exposures_are_told_and_flat_ones_and_references_are_not(folder: Path) -> None:
    cv2.imwrite(str(folder / "left_3.png"), image("left", 1))
    for flat in (2, 4):
        cv2.imwrite(str(folder / f"right_{flat}.png"), np.full(SIZES["right"], 9000, np.uint16))
    (folder / "manifest.toml").write_text(RUN + REFERENCES.replace("_6", "_5"))
    (note,) = import_manifest(folder / "manifest.toml", folder / "out")["notes"]
    assert note.startswith("left, shot 1, exposure A has the very pixels of left, shot 0, exposure A: ")


@pytest.mark.parametrize(("of", "said"), [(10, "background"), (1, "shot")])
def test_one_image_for_two_kinds_of_images_is_told(folder: Path, of: int, said: str) -> None:
    for camera in SIZES:
        cv2.imwrite(str(folder / f"{camera}_5.png"), image(camera, of))
    (folder / "manifest.toml").write_text(RUN + REFERENCES)
    (note,) = import_manifest(folder / "manifest.toml", folder / "out")["notes"]
    assert re.match(
        rf"left, dark \d+, exposure A has the very pixels of left, {said} \d+, exposure A \(and 1 more", note
    )


def test_shots_come_back_as_they_were(folder: Path) -> None:
    with RunReader(run_import(folder, RUN) / "run") as run:
        assert (run.header.polarity, run.header.separation_ns, run.header.frames_per_shot) == ("shadow", 6400, 2)
        assert run.shot_count == 2
        assert run.outcome == "completed"
        shot = run.read_shot(1)
        assert shot.valid
        for camera in SIZES:
            frame_b = shot.views[camera].frame_b
            assert frame_b is not None
            np.testing.assert_array_equal(shot.views[camera].frame_a, image(camera, 3))
            np.testing.assert_array_equal(frame_b, image(camera, 4))
        assert {camera: run.header.views[camera].bits for camera in SIZES} == {"left": 8, "right": 16}
        assert run.dark("left") is None


def test_conditions_and_nozzle_are_kept(folder: Path) -> None:
    notes = 'notes = { fluid = "water", pressure_bar = 6.0, more = { flow_l_min = 1.2 } }'
    out = run_import(folder, RUN.replace("6400", f"6400\n{notes}") + "\n[spray]\nnozzle_mm = [0, -5, 0.5]\n")
    with RunReader(out / "run") as run:
        assert (run.header.notes.fluid, run.header.notes.more) == ("water", {"flow_l_min": 1.2})
        assert run.header.spray == Spray(nozzle_mm=(0, -5, 0.5), axis=(0, 1, 0))


def test_a_nozzle_without_direction_names_its_line(folder: Path) -> None:
    with pytest.raises(ManifestError, match=r"manifest\.toml, line \d+: spray: axis: 0, 0, 0 is no direction"):
        run_import(folder, RUN + "\n[spray]\nnozzle_mm = [0, 0, 0]\naxis = [0, 0, 0]\n")


def test_references_are_kept_and_averaged_a_and_b_apart(folder: Path) -> None:
    with RunReader(run_import(folder, RUN + REFERENCES) / "run") as run:
        keys = [ImageKey.SAMPLE, ImageKey.SAMPLE, ImageKey.BACKGROUND, ImageKey.BACKGROUND, ImageKey.DARK]
        assert run.image_keys().tolist() == keys
        background, dark = run.background("right"), run.dark("left")
        assert background is not None
        assert dark is not None
        np.testing.assert_array_equal(background, np.stack([image("right", 15), image("right", 35)]))
        np.testing.assert_array_equal(dark, np.stack([image("left", 5), image("left", 6)]))


def test_single_exposures_need_no_frame_b(folder: Path) -> None:
    text = f'[run]\npolarity = "bright"\n[[run.shot]]\n{frames("a", 1)}'
    with RunReader(run_import(folder, text) / "run") as run:
        assert run.header.frames_per_shot == 1
        assert run.read_shot(0).views["left"].frame_b is None


def test_root_may_come_from_the_environment(folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("SPRAY_LAB", str(folder.parent))
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    for root in (f"$SPRAY_LAB/{folder.name}", f"${{SPRAY_LAB}}/{folder.name}", ".."):
        (elsewhere / "m.toml").write_text(f'root = "{root}"\n{RUN}')
        out = elsewhere / f"out{len(root)}"
        assert import_manifest(elsewhere / "m.toml", out)["shots"] == 2


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("[run\n", r"manifest\.toml: .*line 1"),
        ("", r"manifest\.toml: neither \[calibration\] nor \[run\]"),
        ('root = "$NO_SUCH_PLACE/x"\n' + RUN, r"manifest\.toml, line 1: root: .*NO_SUCH_PLACE is not set"),
        (RUN.replace('polarity = "shadow"', 'polarity = "dark"'), r"line 2: run\.polarity: "),
        (RUN.replace("6400", "1"), r"line 3: run\.separation_ns: no camera takes exposures 1 ns apart"),
        (RUN.replace("6400", "64_000_000_000"), r"line 3: run\.separation_ns: no camera takes exposures 640"),
        (RUN.replace("6400", "6400\nrate_hz = inf"), r"run.rate_hz: Input should be a finite number"),
        (
            RUN.replace("6400", "6400\nrate_hz = 200_000"),
            r"line 1: run: separation_ns: 6400 ns is no shorter than a shot of rate_hz = 200000, 5000 ns",
        ),
        (
            RUN.replace(frames("b", 2), "").replace(frames("b", 4), ""),
            r"line 1: run: separation_ns: shots have one exposure",
        ),
        (RUN.replace("separation_ns", "seperation_ns"), r"line 3: run\.seperation_ns: there is no such key"),
        (RUN.replace("polarity", "polarty"), r"line 2: run\.polarty: there is no such key"),
        (RUN.replace("left_3", "left_99"), r"line 9: run\.shot\.1\.frame_a\.left: .*left_99\.png does not exist$"),
        (RUN.replace("_3.", "_9."), r"line 9: .*left_9\.png does not exist \(and 1 more\)"),
        (RUN.replace(frames("b", 4), ""), r"line 1: run: shot 2: all of them have frame_b, or none"),
        (
            RUN.replace(', right = "right_2.png"', ""),
            r"line 6: run\.shot\.0\.frame_b: cameras left differ from left, r",
        ),
        (RUN.replace('left_4.png"', 'right_6.png"'), r"line 10: run\.shot\.1\.frame_b\.left: .*40 x 20 px of 16 bit"),
        (RUN.replace("left_2", "left_1"), r"line 6: run\.shot\.0\.frame_b\.left: .*left_1\.png is named twice"),
        (RUN.replace("right_3", "left_3"), r"line 9: run\.shot\.1\.frame_a\.right: .*left_3\.png is named twice"),
        (RUN + REFERENCES.replace("left_10", "left_1"), r"run\.background\.0\.frame_a\.left: .*_1\.png is named twice"),
        (RUN.replace("left_2.png", "manifest.toml"), r"line 6: run\.shot\.0\.frame_b\.left: .*not an image"),
        ('[run]\npolarity = "shadow"\n[[run.shot]]\nframe_a = { left = "left_1.png" }\n', "1 camera, a run has 2 to 8"),
        ("[calibration]\norigin_px = { a = [1, 2] }\n", r"line 1: calibration: neither planes nor points"),
        (
            '[calibration]\n[[calibration.plane]]\nz_mm = 1.0\nimages = { left = "left_1.png" }\n',
            r"line 1: calibration: target: planes need a target",
        ),
        (
            '[calibration]\ntarget = { kind = "checkerboard", pitch_mm = 1 }\n[[calibration.plane]]\n'
            'images = { left = "left_1.png" }\n',
            r"line 2: calibration\.target: a checkerboard needs columns and rows",
        ),
        (
            '[[calibration.points]]\ncamera = "left"\nfile = "manifest.toml"\ncolumns = ["u_px", "v_px", "x_mm"]\n',
            r"line 1: calibration\.points\.0: columns: y_mm, z_mm must appear once",
        ),
        (BOARD.replace("z_mm = 1.0", "z_mm = nan"), r"line 4: calibration\.plane\.0\.z_mm: .* finite number"),
        (BOARD.replace("pitch_mm = 1", "pitch_mm = inf"), r"line 2: calibration\.target\.pitch_mm: .* finite number"),
        (
            BOARD.replace("[[", "origin_px = { middle = [1, 2] }\n[[", 1),
            r"line 1: calibration: origin_px: there is no camera middle",
        ),
        (
            BOARD + "origin_px = { middle = [1, 2] }\n",
            r"line 3: calibration\.plane\.0: origin_px: there is no image of middle",
        ),
    ],
)
def test_mistakes_name_the_line_and_write_nothing(folder: Path, text: str, complaint: str) -> None:
    before = sorted(folder.iterdir())
    with pytest.raises(ManifestError, match=complaint):
        run_import(folder, text)
    assert sorted(folder.iterdir()) == sorted([*before, folder / "manifest.toml"])


def test_nothing_is_overwritten(folder: Path) -> None:
    out = run_import(folder, RUN)
    run_file = (out / "run" / "run.h5").read_bytes()
    with pytest.raises(OutputExistsError, match="out: exists; only --overwrite replaces it"):
        run_import(folder, RUN)
    assert (out / "run" / "run.h5").read_bytes() == run_file


def test_a_manifest_that_is_not_utf8_is_named(tmp_path: Path) -> None:
    (tmp_path / "manifest.toml").write_bytes("# µ\n".encode("latin-1"))
    with pytest.raises(ManifestError, match=r"manifest\.toml: not UTF-8: byte 2 is 0xb5"):
        import_manifest(tmp_path / "manifest.toml", tmp_path / "out")


def test_missing_manifest_is_named(tmp_path: Path) -> None:
    with pytest.raises(ManifestError, match=r"none\.toml: No such file"):
        import_manifest(tmp_path / "none.toml", tmp_path / "out")


BOARD_23 = '[calibration]\ntarget = { kind = "checkerboard", columns = 23, rows = 17, pitch_mm = 1.0 }\n'


def photograph_board(folder: Path, z_mm: float, columns: slice = slice(None), hidden: int = 0) -> str:
    """Write an image of the board at z, cut to some columns, the first ones dark; its plane in a manifest."""
    seen = render_target(paper_cameras(4)["view1"], Checkerboard(), z_mm, paper_optics(4)["view1"])[:, columns]
    seen[:, :hidden] = 0
    cv2.imwrite(str(folder / f"{z_mm:g}.tif"), (40 + 200 * seen).astype(np.uint8))
    return f'[[calibration.plane]]\nz_mm = {z_mm:g}\nimages = {{ view1 = "{z_mm:g}.tif" }}\n'


def test_planes_become_a_set_that_can_be_calibrated_without_the_originals(tmp_path: Path) -> None:
    text = BOARD_23 + "".join(photograph_board(tmp_path, z_mm) for z_mm in (-3.0, -1.0, 1.0, 3.0))
    out = run_import(tmp_path, text)
    for original in tmp_path.glob("*.tif"):
        original.unlink()
    calibration = calibrate(load_calibration_set(out))
    assert calibration.source == "manifest"
    assert [plane.name for plane in calibration.views["view1"].planes] == ["-3.tif", "-1.tif", "1.tif", "3.tif"]
    assert true_errors_px(calibration.views["view1"].mapping, paper_cameras(4)["view1"]).mean() < 0.03
    assert load_calibration_set(out / "calibration").target == calibration.target


def test_a_blank_image_is_left_out_and_a_part_of_the_board_is_told_by_the_others(tmp_path: Path) -> None:
    columns = slice(42, 390)
    text = BOARD_23 + "".join(photograph_board(tmp_path, z_mm, columns) for z_mm in (-4.0, -2.0, 0.0, 2.0, 4.0))
    cv2.imwrite(str(tmp_path / "-2.tif"), np.full((300, 348), 40, np.uint8))
    found = load_calibration_set(run_import(tmp_path, text))
    assert [plane.name for plane in found.views["view1"].planes] == ["-4.tif", "0.tif", "2.tif", "4.tif"]
    blank, part = found.notes
    assert blank == "view1, images/001/-2.tif left out: checkerboard: no corners in a grid"
    assert re.fullmatch(r"view1, images/004/4\.tif: \d+ points of the target; other positions tell which", part)
    cut_px = found.views["view1"].planes[-1].image_px + (columns.start, 0)
    true_px = paper_cameras(4)["view1"].project(found.views["view1"].planes[-1].points_mm)
    assert np.median(np.linalg.norm(cut_px - true_px, axis=1)) < 0.1


def test_a_camera_that_never_sees_the_target_is_refused(tmp_path: Path) -> None:
    text = BOARD_23.replace("23", "24") + photograph_board(tmp_path, 0.0)
    with pytest.raises(CalibrationError, match=r"calibration: view1 never sees the target; .*images/000/0\.tif left"):
        load_calibration_set(run_import(tmp_path, text))


def test_a_part_of_a_board_in_a_free_pose_is_left_out(tmp_path: Path) -> None:
    text = BOARD_23 + photograph_board(tmp_path, 0.0) + photograph_board(tmp_path, 1.0, hidden=150)
    found = load_calibration_set(run_import(tmp_path, re.sub("z_mm = .*\n", "", text)))
    assert [plane.name for plane in found.views["view1"].planes] == ["0.tif"]
    (note,) = found.notes
    assert re.fullmatch(r"view1, images/001/1\.tif left out: .* not the whole board of 23 x 17.*", note)


def test_images_of_a_camera_that_differ_in_size_are_refused(tmp_path: Path) -> None:
    text = BOARD_23 + photograph_board(tmp_path, 0.0) + photograph_board(tmp_path, 1.0, slice(0, 399))
    with pytest.raises(CalibrationError, match=r"images/001/1\.tif: \(399, 300\) px, other images of view1 have \(400"):
        load_calibration_set(run_import(tmp_path, text))


def test_points_take_the_image_size_from_the_run(folder: Path) -> None:
    (folder / "points.txt").write_text("\n".join(f"{n} {n} {n} {n * n} {n % 3}" for n in range(20)))
    points = (
        '[[calibration.points]]\ncamera = "right"\nfile = "points.txt"\n'
        'columns = ["u_px", "v_px", "x_mm", "y_mm", "z_mm"]\n'
    )
    out = run_import(folder, points + RUN)
    assert load_calibration_set(out).views["right"].image_size_px == (40, 20)
