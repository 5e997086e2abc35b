"""``tomoshadow average``: of volumes, and straight from a run."""

import json
from pathlib import Path

import numpy as np
import pytest

from processing.reconstruction.volume_file import read_volume
from server.cli.main import main
from tests.support.command_line import GRID, refused, shown, told
from tests.support.droplet_run import add_background, write_run


@pytest.mark.parametrize("voxels", ["float32", "uint8"])
def test_average_of_results(
    voxels: str, run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    common = ["reconstruct", run_dir, "--calibration", calibration_file, f"--grid={GRID}"]
    assert told(capsys, *common, "-o", tmp_path / "out", "--voxels", voxels)["voxels"] == voxels
    result = told(capsys, "average", tmp_path / "out", "-o", tmp_path / "mean.vtkhdf")
    assert (result["volumes"], result["exposure"]) == (2, "a")
    assert read_volume(tmp_path / "mean.vtkhdf")[0].shape == (21, 21, 21)
    assert Path(result["figure"]).stat().st_size > 1000


@pytest.mark.parametrize("exposure", ["a", "b"])
def test_exposures_a_and_b_are_not_mixed(
    exposure: str, run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--calibration", calibration_file, f"--grid={GRID}"]
    told(capsys, "reconstruct", run_dir, *options, "-o", tmp_path / "out")
    means = []
    sources: list[list[object]] = [[tmp_path / "out"], [run_dir, *options]]
    for number, arguments in enumerate(sources):
        told(capsys, "average", *arguments, "--exposure", exposure, "-o", tmp_path / f"{number}.vtkhdf")
        mean, _, provenance = read_volume(tmp_path / f"{number}.vtkhdf")
        assert provenance["frame"] == exposure
        means.append(mean)
    shots = [read_volume(file)[0] for file in sorted((tmp_path / "out").glob(f"shot_*_{exposure}.vtkhdf"))]
    for mean in means:
        np.testing.assert_allclose(mean, np.mean(shots, axis=0), atol=1e-3 * mean.max())


@pytest.mark.parametrize("method", ["gavlos", "smart"])
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
    assert complaint.startswith(
        f"{tmp_path / 'empty'}: there are no volumes of exposure A to average; the server keeps"
    )
    assert not (tmp_path / "mean.vtkhdf").exists()


def test_people_are_told_where_the_mean_is(
    run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, grid = tmp_path / "mean.vtkhdf", "21 x 21 x 21 voxels of 0.1 mm"
    text = shown(capsys, "average", run_dir, "--calibration", calibration_file, f"--grid={GRID}", "-o", out)
    assert text == f"{out}: mean of 2 volumes of exposure A, {grid}; slices in {tmp_path / 'mean.png'}\n"


def test_a_mean_is_kept_as_float32_unless_asked_for(
    run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--calibration", calibration_file, f"--grid={GRID}", "--shots", "0:1", "-o", tmp_path / "mean.vtkhdf"]
    assert told(capsys, "average", run_dir, *options)["method"] == "mlos"
    settings = json.loads(str(read_volume(tmp_path / "mean.vtkhdf")[2]["settings"]))
    assert settings["voxels"] == "float32"


def test_a_mean_and_its_picture_are_replaced_only_if_asked_for(
    run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mean.png").write_text("a photograph")
    options = ["--calibration", calibration_file, f"--grid={GRID}", "--shots", "0:1", "-o", tmp_path / "mean.vtkhdf"]
    assert (
        refused(capsys, "average", run_dir, *options)
        == f"{tmp_path / 'mean.png'}: exists; only --overwrite replaces it"
    )
    assert (tmp_path / "mean.png").read_text() == "a photograph"
    told(capsys, "average", run_dir, *options, "--overwrite")
    assert (tmp_path / "mean.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("straight", [False, True], ids=["of results", "of a run"])
def test_exposures_that_may_be_wrong_are_told_with_the_mean(
    straight: bool, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_dir = write_run(tmp_path / "covered", shots=2, covered=("view2",))
    options = ["--calibration", calibration_file, f"--grid={GRID}"]
    told(capsys, "reconstruct", run_dir, *options, "-o", tmp_path / "out")
    source = [run_dir, *options] if straight else [tmp_path / "out"]
    assert main(["average", *map(str, source), "-o", str(tmp_path / "mean.vtkhdf"), "--json"]) == 0
    output = capsys.readouterr()
    assert "shot 1, exposure a: view2 sees nothing" in output.err
    assert "2 of 2 exposures may be wrong, and are part of the mean" in output.err
    faults = json.loads(output.out.splitlines()[-1])["faults"]
    assert [(one["shot"], one["blind_views"]) for one in faults] == [(0, ["view2"]), (1, ["view2"])]
    assert json.loads(str(read_volume(tmp_path / "mean.vtkhdf")[2]["faults"])) == faults


@pytest.mark.parametrize("straight", [False, True], ids=["of results", "of a run"])
def test_dim_light_is_told_once_with_what_it_makes_fainter(
    straight: bool, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_dir = add_background(write_run(tmp_path / "dim", shots=2), 222)
    options = ["--calibration", calibration_file, f"--grid={GRID}"]
    line = (
        "had less or more than their backgrounds: voxels by mlos are up to 27 % fainter for that alone (shot 0, "
        "exposure A"
    )
    assert f"light: 4 of 4 exposures {line}" in shown(capsys, "reconstruct", run_dir, *options, "-o", tmp_path / "out")
    source = [run_dir, *options] if straight else [tmp_path / "out"]
    told_of_mean = shown(capsys, "average", *source, "-o", tmp_path / "mean.vtkhdf")
    assert told_of_mean.count("light: ") == 1
    assert f"light: 2 of 2 exposures {line}" in told_of_mean


@pytest.mark.parametrize("straight", [False, True], ids=["of results", "of a run"])
def test_a_shot_that_is_a_copy_of_another_is_told_with_the_mean(
    straight: bool, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_dir = write_run(tmp_path / "copies", shots=2, copies=True)
    options = ["--calibration", str(calibration_file), f"--grid={GRID}"]
    source = [str(run_dir), *options]
    if not straight:
        told(capsys, "reconstruct", run_dir, *options, "-o", tmp_path / "out")
        source = [str(tmp_path / "out")]
    assert main(["average", *source, "-o", str(tmp_path / "mean.vtkhdf"), "--json"]) == 0
    output = capsys.readouterr()
    assert json.loads(output.out.splitlines()[-1])["faults"] == [{"shot": 1, "copy_of": 0}]
    assert "shot 1, exposure a: has the very images of shot 0: one is a copy, and it counts twice" in output.err
