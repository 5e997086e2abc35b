"""The command line: what it prints, and that bad input gets one clear error, an exit status, and loses nothing."""

import json
import os
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from processing.calibration.calibration import Model
from processing.calibration.calibration_file import load_calibration, save_calibration
from processing.calibration.calibration_record import content_id, json_id
from processing.calibration.fit.polynomial import EXPONENTS, PolynomialMapping
from processing.reconstruction.volume_file import read_volume
from processing.runs.pipeline import PipelineError
from server.cli import average_command, commands
from server.cli.main import main
from tests.support import droplet_run
from tests.support.droplet_run import cameras, write_calibration, write_run

GRID = "-1:1,-1:1,-1:1@0.1"
ROOT = Path(__file__).parents[3]


@pytest.fixture
def run_dir(tmp_path: Path) -> Path:
    return write_run(tmp_path / "run", shots=3, invalid=(1,))


@pytest.fixture
def calibration_file(tmp_path: Path) -> Path:
    return write_calibration(tmp_path / "calibration.json")


def told(capsys: pytest.CaptureFixture[str], *arguments: object, status: int = 0) -> dict[str, Any]:
    """The JSON object of a command that worked: the last line of its output."""
    assert main([*map(str, arguments), "--json"]) == status
    result: dict[str, Any] = json.loads(capsys.readouterr().out.splitlines()[-1])
    return result


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The error of a command that did not work: one line for a person, one object for a program."""
    assert main([*map(str, arguments), "--json"]) == 2
    output = capsys.readouterr()
    error: str = json.loads(output.out.splitlines()[-1])["error"]
    assert output.err.endswith(f"tomoshadow: {error}\n")
    assert "Traceback" not in output.err
    return error


def test_reconstruct_tells_grid_and_volumes(
    run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["reconstruct", run_dir, "--calibration", calibration_file, "-o", tmp_path / "out", f"--grid={GRID}"]
    result = told(capsys, *arguments)
    assert (result["method"], result["accuracy"], result["voxels"]) == ("mlos", "nominal", "float16")
    assert result["grid"] == {"shape": [21, 21, 21], "origin_mm": [-1, -1, -1], "pitch_mm": 0.1}
    assert [(volume["shot"], volume["frame"]) for volume in result["volumes"]] == [
        (0, "a"),
        (0, "b"),
        (2, "a"),
        (2, "b"),
    ]
    assert {view["mapping"] for view in result["views"].values()} == {"exact"}, "voxels of 2 px are averaged"
    assert result["views"]["view2"]["reason"] == "a voxel covers 2 px, limit 1.5 px"
    assert result["cpu_s"] > 0
    assert result["peak_rss_mb"] > 0
    assert all((tmp_path / "out" / volume["file"]).is_file() for volume in result["volumes"])


def test_reconstruct_says_before_the_second_shot_which_views_are_slow(
    run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["reconstruct", run_dir, "--calibration", calibration_file, "-o", tmp_path / "out", f"--grid={GRID}"]
    assert main([*map(str, arguments)]) == 0
    _invalid, first, *slow, second = capsys.readouterr().err.splitlines()
    assert (first, second) == ("run: shot 0 by mlos", "run: shot 2 by mlos")
    assert [line.split()[0] for line in slow] == ["view1", "view2", "view3"]
    assert all("takes the exact way, which is slower" in line and "a voxel covers" in line for line in slow)


def test_a_view_that_sees_nothing_is_named_with_every_volume(
    calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_dir = write_run(tmp_path / "run", covered=("view2",))
    arguments = ["reconstruct", run_dir, "--calibration", calibration_file, "-o", tmp_path / "out", f"--grid={GRID}"]
    assert main([*map(str, arguments), "--json"]) == 0
    output = capsys.readouterr()
    assert [volume["blind_views"] for volume in json.loads(output.out)["volumes"]] == [["view2"], ["view2"]]
    assert "shot 0, exposure a: view2 sees nothing; is the shot empty, or a lens covered" in output.err
    assert "exposure b: view2 sees nothing" in output.err
    assert read_volume(tmp_path / "out" / "shot_00000_a.vtkhdf")[2]["blind_views"] == '["view2"]'


def test_views_that_see_droplets_are_not_named(
    run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["reconstruct", run_dir, "--calibration", calibration_file, "-o", tmp_path / "out", f"--grid={GRID}"]
    assert [volume["blind_views"] for volume in told(capsys, *arguments)["volumes"]] == [[]] * 4


def test_shots_can_be_chosen(
    run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    common = ["reconstruct", run_dir, "--calibration", calibration_file, f"--grid={GRID}", "--method", "minlos"]
    result = told(capsys, *common, "-o", tmp_path / "out", "--shots", "1:3")
    assert {volume["shot"] for volume in result["volumes"]} == {2}
    assert "no valid sample shots" in refused(capsys, *common, "-o", tmp_path / "out", "--shots", "1:2")
    assert "not of the form A:B" in refused(capsys, *common, "-o", tmp_path / "out", "--shots", "first")


def test_smart_is_told_how_to_iterate(
    run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    common = ["reconstruct", run_dir, "--calibration", calibration_file, f"--grid={GRID}", "--method", "smart"]
    options = ["--iterations", "9", "--relaxation", "0.5", "--least-gain", "0.9"]
    result = told(capsys, *common, "-o", tmp_path / "out", "--shots", "0:1", *options)
    assert {len(volume["residuals"]) for volume in result["volumes"]} == {2}  # no iteration gains that much
    for option, limit in (("--iterations", "200"), ("--relaxation", "2"), ("--least-gain", "1")):
        with pytest.raises(SystemExit):
            main([*map(str, common), "-o", str(tmp_path / "out"), option, "201"])
        assert f"argument {option}: 201: Input should be less than" in (error := capsys.readouterr().err)
        assert limit in error


def test_finer_images_are_asked_for_by_name(
    run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    common = ["reconstruct", run_dir, "--calibration", calibration_file, "--grid=-1:1,-1:1,-1:1@0.05", "--shots", "0:1"]
    nominal = told(capsys, *common, "-o", tmp_path / "nominal")
    assert {view["mapping"] for view in nominal["views"].values()} == {"rectified"}
    assert told(capsys, *common, "-o", tmp_path / "fine", "--accuracy", "fine")["accuracy"] == "fine"
    volumes = [read_volume(tmp_path / name / "shot_00000_a.vtkhdf") for name in ("nominal", "fine")]
    assert json.loads(str(volumes[1][2]["settings"]))["accuracy"] == "fine"
    assert 0 < np.abs(volumes[1][0] - volumes[0][0]).max() < 0.2


@pytest.mark.parametrize("voxels", ["float32", "float16", "uint8"])
def test_average_of_results(
    voxels: str, run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    common = ["reconstruct", run_dir, "--calibration", calibration_file, f"--grid={GRID}"]
    assert told(capsys, *common, "-o", tmp_path / "out", "--voxels", voxels)["voxels"] == voxels
    result = told(capsys, "average", tmp_path / "out", "-o", tmp_path / "mean.vtkhdf")
    assert result["volumes"] == 4
    assert read_volume(tmp_path / "mean.vtkhdf")[0].shape == (21, 21, 21)
    assert Path(result["figure"]).stat().st_size > 1000


@pytest.mark.parametrize("method", ["mlos", "gavlos", "smart"])
def test_average_of_a_run_is_the_average_of_its_results(
    method: str, run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--calibration", calibration_file, f"--grid={GRID}", "--method", method, "--iterations", 2]
    told(capsys, "reconstruct", run_dir, *options, "-o", tmp_path / "out")
    stored = told(capsys, "average", tmp_path / "out", "-o", tmp_path / "stored.vtkhdf")
    straight = told(capsys, "average", run_dir, *options, "-o", tmp_path / "straight.vtkhdf")
    assert (straight["volumes"], straight["grid"]) == (stored["volumes"], stored["grid"])
    volumes = [read_volume(tmp_path / f"{name}.vtkhdf")[0].astype(np.float64) for name in ("stored", "straight")]
    assert volumes[0].max() > 0
    np.testing.assert_allclose(volumes[1], volumes[0], atol=2e-3 * volumes[0].max())


def test_a_run_is_averaged_with_a_calibration_only(
    run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "name its --calibration" in refused(capsys, "average", run_dir, "-o", tmp_path / "mean.vtkhdf")


def test_average_of_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "empty").mkdir()
    complaint = refused(capsys, "average", tmp_path / "empty", "-o", tmp_path / "mean.vtkhdf")
    assert complaint == f"{tmp_path / 'empty'}: there are no volumes to average"
    assert not (tmp_path / "mean.vtkhdf").exists()


def test_a_picture_never_takes_the_place_of_its_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("calibrate", "average"):
        complaint = refused(capsys, command, tmp_path, "-o", tmp_path / "result.png")
        assert complaint == f"{tmp_path / 'result.png'}: its picture would take its place; choose another ending"


def test_a_grid_may_begin_below_zero_with_or_without_an_equals_sign(
    run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    common = ["reconstruct", run_dir, "--calibration", calibration_file, "--shots", "0:1"]
    joined = told(capsys, *common, "-o", tmp_path / "joined", f"--grid={GRID}")
    assert told(capsys, *common, "-o", tmp_path / "apart", "--grid", GRID)["grid"] == joined["grid"]
    assert "every range must grow" in refused(capsys, *common, "-o", tmp_path / "x", "--grid", "-.5:-1,0:1,0:1")


@pytest.mark.parametrize("grid", ["-1.:1.,-1:+1.0,-10e-1:1e0@1e-1", "-1:1,-1.:1,-1:1.E+0@.1"])
def test_a_grid_takes_numbers_in_every_spelling(grid: str, calibration_file: Path) -> None:
    calibration = load_calibration(calibration_file)
    assert commands.parse_grid(grid, calibration) == commands.parse_grid(GRID, calibration)


@pytest.mark.parametrize("grid", ["0:1,0:1,0:1e999", "0:1,0:1,0:e0", "0:1,0:1,0:.", "0:nan,0:1,0:1", "0:1,0:1,0:1@0x1"])
def test_a_grid_of_other_words_is_named(grid: str, calibration_file: Path) -> None:
    with pytest.raises(PipelineError, match=re.escape(f"--grid {grid!r} is not of the form X0:X1")):
        commands.parse_grid(grid, load_calibration(calibration_file))


@pytest.mark.parametrize(
    ("grid", "reason"),
    [
        ("1:2,3:4", "not of the form"),
        ("1:0,0:1,0:1", "must grow"),
        ("0:1,0:1,0:1@0", "positive"),
        ("0:1,0:1,0:1e99", "e+100 voxels, at most 1e+12"),
    ],
)
def test_impossible_grids(
    grid: str, reason: str, run_dir: Path, calibration_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["reconstruct", run_dir, "--calibration", calibration_file, "-o", run_dir / "x", f"--grid={grid}"]
    assert reason in refused(capsys, *arguments)


def edited(calibration_file: Path, edit: Callable[[Any], None]) -> Path:
    """A calibration file that says something else, with the id that belongs to it."""
    content = json.loads(calibration_file.read_text())
    edit(content)
    content["id"] = json_id(content)
    calibration_file.write_text(json.dumps(content))
    return calibration_file


def no_common_depth(content: Any) -> None:
    content["z_range_mm"] = [1.0, -1.0]


def targets_out_of_sight(content: Any) -> None:
    for view in content["views"].values():
        view["extent_mm"] = [[200.0, -2.0], [240.0, 2.0]]


@pytest.mark.parametrize(
    ("edit", "complaint"),
    [
        (no_common_depth, "the views share no range along z: it would go from 1 to -1 mm"),
        (targets_out_of_sight, "the 3 views see no common volume within x 190 to 250, y -3 to 3, z -1.5 to 1.5 mm"),
    ],
)
@pytest.mark.parametrize("command", ["reconstruct", "average"])
def test_views_that_share_nothing_are_one_clear_error(
    command: str,
    edit: Callable[[Any], None],
    complaint: str,
    run_dir: Path,
    calibration_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    arguments = [command, run_dir, "--calibration", edited(calibration_file, edit), "-o", tmp_path / "out"]
    assert refused(capsys, *arguments) == complaint
    assert not (tmp_path / "out").exists()


def test_a_run_of_one_view_is_one_clear_error(
    calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    only = {"view2": cameras()["view2"]}
    monkeypatch.setattr(droplet_run, "cameras", lambda: only)
    run_dir = write_run(tmp_path / "one")
    message = refused(capsys, "reconstruct", run_dir, "--calibration", calibration_file, "-o", tmp_path / "out")
    assert message == "1 views, a reconstruction takes 2 to 8"


def test_a_mapping_that_runs_away_is_one_clear_error(
    run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    coefficients = np.zeros((len(EXPONENTS), 2))
    coefficients[EXPONENTS.index((3, 0, 0))] = 1e6
    wild = PolynomialMapping(coefficients, np.zeros(3), np.ones(3), (160, 120))
    calibration_file = tmp_path / "wild.json"
    calibration = load_calibration(write_calibration(calibration_file))
    views = {name: replace(view, mapping=wild, model=Model.POLYNOMIAL) for name, view in calibration.views.items()}
    rough = replace(calibration, views=views)
    save_calibration(rough.with_id(content_id(rough)), calibration_file, overwrite=True)
    arguments = ["reconstruct", run_dir, "--calibration", calibration_file, f"--grid={GRID}", "-o", tmp_path / "out"]
    assert refused(capsys, *arguments).startswith("view1: mapping is not smooth: it bends by")


def test_instructions_that_the_processor_lacks_are_one_clear_error(
    run_dir: Path,
    calibration_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("TOMOSHADOW_ISA", "sse9")
    arguments = ["reconstruct", run_dir, "--calibration", calibration_file, f"--grid={GRID}", "-o", tmp_path / "out"]
    assert refused(capsys, *arguments).startswith("TOMOSHADOW_ISA is sse9, this processor runs plain")


def test_a_volume_beyond_the_memory_fails_without_a_traceback(
    run_dir: Path,
    calibration_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def too_much(*_: object, **_options: object) -> None:
        np.empty(2**62, dtype=np.uint8)

    monkeypatch.setattr(commands, "reconstruct_shot", too_much)
    arguments = ["reconstruct", run_dir, "--calibration", calibration_file, f"--grid={GRID}", "-o", tmp_path / "out"]
    assert main([*map(str, arguments)]) == 1
    assert "Unable to allocate" in capsys.readouterr().err


@pytest.mark.parametrize(("command", "module"), [("reconstruct", commands), ("average", average_command)])
def test_a_command_takes_the_processors_that_it_may_use(
    command: str,
    module: ModuleType,
    run_dir: Path,
    calibration_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def tell(*_: object, threads: int) -> None:
        raise PipelineError(f"{threads} threads")

    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 2, 5})
    monkeypatch.setattr(module, "reconstruct_shot" if module is commands else "average_run", tell)
    arguments = [command, run_dir, "--calibration", calibration_file, f"--grid={GRID}", "-o", tmp_path / "out"]
    assert refused(capsys, *arguments) == "3 threads"


def test_a_truncated_shot_is_named_and_the_others_stay(
    run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    torn = run_dir / "shots" / "0.h5"
    torn.write_bytes(torn.read_bytes()[: torn.stat().st_size // 2])
    common = ["reconstruct", run_dir, "--calibration", calibration_file, f"--grid={GRID}", "-o", tmp_path / "out"]
    assert str(torn) in refused(capsys, *common)
    assert {volume["shot"] for volume in told(capsys, *common, "--shots", "2:3")["volumes"]} == {2}


def test_a_run_that_is_none(calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["reconstruct", tmp_path / "nowhere", "--calibration", calibration_file, "-o", tmp_path / "out"]
    assert refused(capsys, *arguments) == f"{tmp_path / 'nowhere'}: there is no such directory"
    (tmp_path / "nowhere").mkdir()
    assert refused(capsys, *arguments) == f"{tmp_path / 'nowhere'}: no run, it has no run.h5"
    assert not (tmp_path / "out").exists()


def test_a_calibration_that_is_none(run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "broken.json").write_text("{")
    arguments = ["reconstruct", run_dir, "--calibration", tmp_path / "broken.json", "-o", tmp_path / "out"]
    assert "broken.json" in refused(capsys, *arguments)


def test_a_manifest_with_a_missing_image_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    manifest = tmp_path / "manifest.toml"
    manifest.write_text('[run]\npolarity = "bright"\n\n[[run.shot]]\nframe_a = { left = "a.png", right = "b.png" }\n')
    message = refused(capsys, "import", manifest, "-o", tmp_path / "out")
    assert f"{manifest}, line 5: " in message
    assert "a.png" in message
    assert sorted(path.name for path in tmp_path.iterdir()) == ["manifest.toml"]


def test_an_import_never_overwrites(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "precious").write_text("kept")
    manifest = tmp_path / "manifest.toml"
    manifest.write_text('[run]\npolarity = "bright"\n')
    assert refused(capsys, "import", manifest, "-o", tmp_path / "out")
    assert (tmp_path / "out" / "precious").read_text() == "kept"


def test_degenerate_planes_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """All points in one plane: a fit would have a tiny residual and be wrong by millimetres."""
    rows = [f"{100 + 20 * x} {80 + 20 * y} {x} {y} 0" for x in range(12) for y in range(9)]
    (tmp_path / "points.txt").write_text("\n".join(rows) + "\n")
    manifest = tmp_path / "manifest.toml"
    manifest.write_text(
        '[[calibration.points]]\ncamera = "view1"\nfile = "points.txt"\nimage_size_px = [640, 480]\n'
        'columns = ["u_px", "v_px", "x_mm", "y_mm", "z_mm"]\n'
    )
    told(capsys, "import", manifest, "-o", tmp_path / "set")
    message = refused(capsys, "calibrate", tmp_path / "set" / "calibration", "-o", tmp_path / "calibration.json")
    assert "view1" in message
    assert not (tmp_path / "calibration.json").exists()


def test_calibrate_measured_points_and_never_overwrite(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _write_points(tmp_path)
    told(capsys, "import", tmp_path / "manifest.toml", "-o", tmp_path / "set")
    arguments = ["calibrate", tmp_path / "set" / "calibration", "-o", tmp_path / "calibration.json"]
    view = told(capsys, *arguments)["views"]["view1"]
    assert view["n_points"] == 27 * 9
    assert view["holdout_error_px"] < 0.01
    assert view["verdict"] == "good"
    assert set(view["placement"]) == {"azimuth_deg", "pitch_deg", "roll_deg", "centre_mm"}
    assert [plane["z_mm"] for plane in view["planes"]] == [-1.5, 0, 1.5]
    for plane in view["planes"]:
        assert plane["mean_error_px"] < plane["rms_px"] < plane["max_error_px"] <= view["max_error_px"]
        assert 0 < plane["holdout_error_px"] < 0.01
    before = (tmp_path / "calibration.json").read_bytes()
    assert "not overwritten" in refused(capsys, *arguments)
    assert (tmp_path / "calibration.json").read_bytes() == before


@pytest.mark.parametrize(
    "command", [["calibrate", "nowhere"], ["self-calibrate", "nowhere", "--calibration", "nowhere.json"]]
)
def test_a_calibration_that_exists_is_refused_before_anything_is_computed(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "calibration.json").write_text("kept")
    complaint = refused(capsys, *command, "-o", tmp_path / "calibration.json")
    assert complaint == f"{tmp_path / 'calibration.json'}: exists; a calibration is not overwritten unless asked to"
    assert (tmp_path / "calibration.json").read_text() == "kept"


def test_origins_are_stated_for_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _write_points(tmp_path)
    told(capsys, "import", tmp_path / "manifest.toml", "-o", tmp_path / "set")
    arguments = ["calibrate", tmp_path / "set", "-o", tmp_path / "calibration.json", "--origin"]
    message = refused(capsys, *arguments, "view1@-4.5=812,604.5")
    assert "set.json: an imported set states its origins and rolls itself" in message
    with pytest.raises(SystemExit):
        main([*map(str, arguments), "view1=812,604"])
    assert "not of the form VIEW@Z=U,V" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main([*map(str, arguments[:-1]), "--roll", "view1"])
    assert "not of the form VIEW=DEG" in capsys.readouterr().err
    assert "states its origins and rolls itself" in refused(capsys, *arguments[:-1], "--roll", "view1=-90")


def test_a_refused_view_is_written_and_fails_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _write_points(tmp_path, noise_px=3.0)
    told(capsys, "import", tmp_path / "manifest.toml", "-o", tmp_path / "set")
    result = told(capsys, "calibrate", tmp_path / "set", "-o", tmp_path / "calibration.json", status=1)
    assert (result["passed"], result["views"]["view1"]["verdict"]) == (False, "refuse")
    assert load_calibration(tmp_path / "calibration.json").id == result["id"]
    assert main(["calibrate", str(tmp_path / "set"), "-o", str(tmp_path / "again.json")]) == 1
    error_px = result["views"]["view1"]["holdout_error_px"]
    assert f"view1: REFUSED, hold-out error {error_px:.3g} px" in capsys.readouterr().err


def _write_points(folder: Path, noise_px: float = 0.0) -> None:
    """Three planes of points of a known camera, and the manifest that names them."""
    x_mm, y_mm, z_mm = np.meshgrid(np.linspace(-3, 3, 9), np.linspace(-2, 2, 9), [-1.5, 0, 1.5])
    points_mm = np.column_stack([x_mm.ravel(), y_mm.ravel(), z_mm.ravel()])
    seen_px = cameras()["view1"].project(points_mm)
    seen_px += np.random.default_rng(1).normal(0, noise_px, seen_px.shape)
    np.savetxt(folder / "points.txt", np.column_stack([seen_px, points_mm]))
    (folder / "manifest.toml").write_text(
        '[[calibration.points]]\ncamera = "view1"\nfile = "points.txt"\nimage_size_px = [160, 120]\n'
        'columns = ["u_px", "v_px", "x_mm", "y_mm", "z_mm"]\n'
    )


def test_optics_of_the_papers_rig(capsys: pytest.CaptureFixture[str]) -> None:
    result = told(capsys, "optics", "--config", ROOT / "configs" / "spray4view.toml")
    assert [round(view["airy_diameter_um"]) for view in result["views"].values()] == [39, 28, 28, 38]


def test_a_misspelt_configuration_key_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    config = tmp_path / "configs" / "simulated.toml"
    config.write_text(config.read_text().replace("led_channel = 0", "led_chanel = 0"))
    assert "led_chanel" in refused(capsys, "optics", "--config", config)


def test_unknown_usage_exits_with_2(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["reconstruct", "--method", "magic"])
    assert stopped.value.code == 2
    assert "usage" in capsys.readouterr().err
