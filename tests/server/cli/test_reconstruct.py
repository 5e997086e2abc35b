"""``tomoshadow reconstruct``: bad input gets one clear error, an exit status, and loses nothing."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tomoshadow as ts
from processing.calibration.calibration import Model
from processing.calibration.calibration_file import load_calibration, save_calibration
from processing.calibration.calibration_record import content_id, json_id
from processing.calibration.polynomial_mapping import EXPONENTS, PolynomialMapping
from processing.reconstruction.volume_file import read_volume
from server.cli.main import main
from tests.support import droplet_run
from tests.support.command_line import GRID, refused, told
from tests.support.droplet_run import cameras, write_calibration, write_run


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
    assert result["views"]["view2"]["reason"] == "a voxel is 2 px wide, limit 1.5 px"
    assert result["cpu_s"] > 0
    assert result["peak_rss_mb"] > 0
    assert all((tmp_path / "out" / volume["file"]).is_file() for volume in result["volumes"])


def test_reconstruct_says_before_the_second_shot_which_views_are_slow(
    run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["reconstruct", run_dir, "--calibration", calibration_file, "-o", tmp_path / "out", f"--grid={GRID}"]
    assert main([*map(str, arguments)]) == 0
    output, progress = capsys.readouterr()
    _invalid, first, *slow, second = progress.splitlines()
    assert (first, second) == ("run: shot 0 by mlos", "run: shot 2 by mlos")
    assert [line.split()[0] for line in slow] == ["view1", "view2", "view3"]
    assert all(re.search(r"takes the exact way, which is slower.*px wide, limit 1.5 px", line) for line in slow)
    heads, *volumes, summary, _belonging, unchecked, _height = output.splitlines()
    assert heads.split() == ["shot", "exposure", "seconds", "file"]
    assert [tuple(line.split()[:2]) for line in volumes] == [("0", "A"), ("0", "B"), ("2", "A"), ("2", "B")]
    assert all((tmp_path / "out" / line.split()[3]).is_file() for line in volumes)
    assert "whether grey values are in proportion to light" in unchecked
    assert summary.startswith(f"{tmp_path / 'out'}: 4 volumes by mlos, 21 x 21 x 21 voxels of 0.1 mm; ")


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


def test_volumes_are_replaced_only_if_asked_for_and_further_shots_may_join(
    run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    common = ["reconstruct", run_dir, "--calibration", calibration_file, f"--grid={GRID}", "-o", out]
    told(capsys, *common, "--shots", "0:1")
    before = (out / "shot_00000_a.vtkhdf").read_bytes()
    assert refused(capsys, *common) == f"{out / 'shot_00000_a.vtkhdf'}: exists; only --overwrite replaces it"
    assert "choose another" in refused(capsys, *common, "--shots", "2:3", "--method", "minlos")
    told(capsys, *common, "--shots", "2:3")
    assert (out / "shot_00000_a.vtkhdf").read_bytes() == before
    told(capsys, *common, "--shots", "2:3", "--method", "minlos", "--overwrite")
    assert sorted(file.name for file in out.glob("*.vtkhdf")) == ["shot_00002_a.vtkhdf", "shot_00002_b.vtkhdf"]
    (run_dir / "shots" / "0.h5").write_bytes(b"torn")
    refused(capsys, *common, "--shots", "0:1", "--overwrite")
    assert (out / "shot_00002_a.vtkhdf").exists()
    (tmp_path / "home" / "letters").mkdir(parents=True)
    message = refused(capsys, *common[:-1], tmp_path / "home", "--shots", "2:3", "--overwrite")
    assert message == f"{tmp_path / 'home'}: is a folder that this command has not made; it is not replaced"


def test_a_grid_that_nobody_stated_says_what_it_holds(
    run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    common = ["reconstruct", run_dir, "--calibration", calibration_file, "--shots", "0:1"]
    assert main([*map(str, common), "-o", str(tmp_path / "out"), "--json"]) == 0
    output, progress = capsys.readouterr()
    told_percent = re.search(
        r"all views see holds (\d+) % of the calibrated volume \(x -3 to 3, .*; --grid takes", progress
    )
    assert told_percent is not None
    share = json.loads(output)["calibrated_share"]
    assert int(told_percent[1]) == round(100 * share)
    assert 0.5 < share <= 1
    small = told(capsys, *common, "-o", tmp_path / "small", "--grid=-3:0,-2.5:2.5,-1.5:1.5@0.1")
    assert small["calibrated_share"] == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("command", ["reconstruct", "average"])
def test_coarse_voxels_are_told_in_the_words_of_python(
    command: str, run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    calibration = load_calibration(calibration_file)
    with pytest.warns(UserWarning, match="^a voxel is 6 px wide") as warned:
        ts.plan(calibration, ts.VoxelGrid((9, 9, 9), (-1.2, -1.2, -1.2), 0.3))
    out = tmp_path / "out.vtkhdf"
    common = [command, run_dir, "--calibration", calibration_file, "-o", out]
    assert main([*map(str, common), "--grid=-1.2:1.2,-1.2:1.2,-1.2:1.2@0.3"]) == 0
    assert capsys.readouterr().err.count(str(warned[0].message)) == 1


@pytest.mark.parametrize("command", ["reconstruct", "measure"])
def test_a_box_in_um_is_told_to_lie_far_outside(
    command: str, run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    common = [command, run_dir, "--calibration", calibration_file, "-o", tmp_path / "out"]
    assert refused(capsys, *common, "--grid=-1000:1000,-500:500,-500:500@50") == (
        "the grid, x -1000 to 1000, y -500 to 500, z -500 to 500 mm, lies far outside of what was calibrated, x -3 to "
        "3, y -2.5 to 2.5, z -1.5 to 1.5 mm: there no mapping is known; is it in mm, and where the target was?"
    )


def test_a_grid_beyond_the_target_is_asked_about(
    run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    common = ["reconstruct", run_dir, "--calibration", calibration_file, "--shots", "0:1"]
    for number, (z_mm, told_mm) in enumerate(
        (("-2:2", ""), ("-6:6", "the grid reaches 4.5 mm beyond the z of the target"))
    ):
        grid = f"--grid=-1:1,-0.4:0.4,{z_mm}@0.1"
        assert main([*map(str, common), "-o", str(tmp_path / f"out{number}"), grid]) == 0
        progress = capsys.readouterr().err
        assert told_mm in progress
        assert bool(told_mm) == ("beyond the z" in progress)


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

    monkeypatch.setattr("processing.runs.volumes.pipeline.reconstruct_shots", too_much)
    arguments = ["reconstruct", run_dir, "--calibration", calibration_file, f"--grid={GRID}", "-o", tmp_path / "out"]
    assert main([*map(str, arguments)]) == 1
    assert "Unable to allocate" in capsys.readouterr().err


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
    (tmp_path / "image.png").touch()
    told_of_file = refused(capsys, "reconstruct", tmp_path / "image.png", *arguments[2:])
    assert "is a file, and a run is a directory: images become one by tomoshadow import" in told_of_file
    assert not (tmp_path / "out").exists()


def test_a_calibration_that_is_none(run_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "broken.json").write_text("{")
    arguments = ["reconstruct", run_dir, "--calibration", tmp_path / "broken.json", "-o", tmp_path / "out"]
    assert "broken.json" in refused(capsys, *arguments)
