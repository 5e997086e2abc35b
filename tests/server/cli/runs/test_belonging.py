"""reconstruct and average ask droplets whether run and calibration belong together: volumes look fine either way."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest

from processing.calibration.calibration_file import load_calibration, save_calibration
from processing.reconstruction.volume_file import read_volume
from processing.runs.results_file import ExposureKey
from processing.runs.shots.meetings import Meeting, pale_views, seldom_meeting
from processing.synthetic.stamping import FloatImage
from server.cli.main import main
from server.cli.runs.belonging import Belonging, ask_seldom
from tests.support.command_line import told
from tests.support.drifting_run import write_droplet_run
from tests.support.drifting_views import calibration_of, views
from tests.support.droplet_run import write_calibration, write_run

GRID = "--grid=-1:1,-1:1,-1:1@0.1"


@pytest.fixture
def calibration_file(tmp_path: Path) -> Path:
    save_calibration(calibration_of(views()), tmp_path / "calibration.json")
    return tmp_path / "calibration.json"


@pytest.mark.parametrize(
    ("command", "out"), [("reconstruct", "volumes"), ("average", "mean.vtkhdf")], ids=["reconstruct", "average"]
)
def test_a_view_that_has_moved_does_not_pass_in_silence(
    command: str, out: str, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_dir = write_droplet_run(tmp_path / "run")
    arguments = [command, run_dir, "--calibration", calibration_file, GRID, "-o", tmp_path / out]
    answer = told(capsys, *arguments, status=1)
    assert (tmp_path / out).exists(), "nothing that was computed is thrown away"
    assert answer["passed"] is False
    assert answer["belonging"]["verdict"] == "refuse"
    assert "whether grey values are in proportion to light" in answer["belonging"]["not_checked"][0]["what"]
    assert [(shot["shot"], shot["moved"]) for shot in answer["belonging"]["shots"]] == [(0, "view2"), (1, "view2")]
    files = sorted(tmp_path.rglob("*.vtkhdf"))
    for _, _, provenance in map(read_volume, files):
        assert json.loads(str(provenance.get("belonging", "{}"))) == answer["belonging"]
    if command == "reconstruct":
        mean = told(capsys, "average", tmp_path / out, "-o", tmp_path / "mean.vtkhdf", status=1)
        assert (mean["passed"], mean["belonging"]) == (False, answer["belonging"])


def test_a_view_that_moves_and_comes_back_does_not_pass_in_silence(
    calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_dir = write_droplet_run(tmp_path / "run", shots=3, drifting=(1,))
    arguments = ["average", run_dir, "--calibration", calibration_file, GRID, "-o", tmp_path / "mean.vtkhdf"]
    belonging = told(capsys, *arguments, status=1)["belonging"]
    assert belonging["verdict"] == "refuse"
    assert [(shot["shot"], shot["moved"]) for shot in belonging["shots"]] == [(0, None), (1, "view2"), (2, None)]


@pytest.mark.parametrize(
    ("command", "out"), [("reconstruct", "volumes"), ("average", "mean.vtkhdf")], ids=["reconstruct", "average"]
)
def test_a_view_that_moves_for_a_shot_that_nobody_asks_in_full_does_not_pass_in_silence(
    command: str, out: str, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Neither the first, nor the middle, nor the last shot; lines of sight meet seldom in it."""
    run_dir = write_droplet_run(tmp_path / "run", shots=6, drifting=(1,))
    arguments = [command, run_dir, "--calibration", calibration_file, GRID, "-o", tmp_path / out]
    belonging = told(capsys, *arguments, status=1)["belonging"]
    assert belonging["verdict"] == "refuse"
    asked = [(shot["shot"], shot["moved"]) for shot in belonging["shots"]]
    assert asked == [(0, None), (3, None), (5, None), (1, "view2")]


def out_of_focus(image: FloatImage) -> FloatImage:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 1.2), np.float32)


def half_veiled(image: FloatImage) -> FloatImage:
    left = np.arange(image.shape[1]) < image.shape[1] / 2
    return np.where(left, np.float32(0.6) * image, image)


@pytest.mark.parametrize(("command", "change"), [("reconstruct", out_of_focus), ("average", half_veiled)])
def test_a_view_that_is_pale_for_one_shot_is_told(
    command: str,
    change: Callable[[FloatImage], FloatImage],
    calibration_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Lines of sight meet as ever, and volumes look fine."""
    run_dir = write_droplet_run(tmp_path / "run", drift_px=0, shots=3, odd={1: change})
    arguments = [command, run_dir, "--calibration", calibration_file, GRID, "-o", tmp_path / "mean.vtkhdf", "--json"]
    assert main([str(one) for one in arguments]) == 0
    output = capsys.readouterr()
    answer = json.loads(output.out.splitlines()[-1])
    exposures = answer["volumes"] if command == "reconstruct" else answer["faults"]
    odd = {(one["shot"], view): what for one in exposures for view, what in one["odd_light"].items()}
    assert list(odd) == [(1, "view2")]
    assert "% of the contrast that it has in other shots" in odd[1, "view2"]
    assert f"shot 1, exposure a: view2 {odd[1, 'view2']}" in output.err
    if command == "reconstruct":
        (tmp_path / "mean.vtkhdf" / "shot_00001_a.vtkhdf").unlink()
        (tmp_path / "mean.vtkhdf" / "shot_00001_b.vtkhdf").unlink()
        alone = told(capsys, *arguments[:-1], "--shots", "1:2")["volumes"]
        assert [list(one["odd_light"]) for one in alone] == [["view2"]] * 2
        (fault,) = told(capsys, "average", tmp_path / "mean.vtkhdf", "-o", tmp_path / "mean2.vtkhdf")["faults"]
        assert (fault["shot"], list(fault["odd_light"])) == (1, ["view2"])


def test_contrasts_that_scatter_or_are_few_make_no_view_pale() -> None:
    def said(contrasts: Sequence[float], droplets: int = 40, error: float = 0.01) -> list[int]:
        meetings: dict[ExposureKey, Meeting] = {
            (shot, "a"): Meeting(droplets=droplets, contrasts={"view1": one}, errors={"view1": error})
            for shot, one in enumerate(contrasts)
        }
        return [shot for shot, _ in pale_views(meetings)]

    assert said([0.9, 0.91, 0.6]) == [2]
    assert said([0.9, 0.91, 0.8]) == []
    assert said([0.9, 0.6]) == []
    assert said([0.9, 0.91, 0.6], droplets=9) == []
    assert said([0.9, 0.91, 0.6], error=0.07) == []


def odd_of(counts: dict[int, int]) -> list[int]:
    return seldom_meeting({(shot, "a"): Meeting(droplets=count) for shot, count in counts.items()})


def test_no_shot_stands_out_where_all_are_alike_or_droplets_few() -> None:
    for counts in ({}, {0: 0, 1: 0}, {0: 9, 1: 0}, {0: 30, 1: 18, 2: 40, 3: 31}, dict.fromkeys(range(9), 50)):
        assert odd_of(counts) == []
    assert odd_of({0: 30, 1: 12, 2: 40, 3: 31, 4: 2}) == [4, 1]


def test_all_shots_that_stand_out_are_named() -> None:
    counts = dict.fromkeys(range(20), 50) | {2: 5, 7: 3, 8: 1, 11: 4, 16: 2}
    assert odd_of(counts) == [8, 16, 7, 11, 2]


def test_of_very_many_shots_that_stand_out_those_that_are_not_asked_are_named(
    calibration_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_dir = write_droplet_run(tmp_path / "run", shots=6, drifting=(1, 2, 4))
    monkeypatch.setattr("server.cli.runs.belonging.MOST_SELDOM", 1)
    asked = ask_seldom(Belonging("run", ()), [2, 4, 1], run_dir, load_calibration(calibration_file))
    assert [(check.shot, check.moved) for check in asked.checks] == [(2, "view2")]
    assert asked.record()["not_asked"] == [1, 4]
    assert "NOT CHECKED" in asked.text
    assert "shots 1, 4" in asked.text


def test_what_droplets_do_not_tell_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run_dir, calibration_file = write_run(tmp_path / "run"), write_calibration(tmp_path / "calibration.json")
    arguments = ["reconstruct", run_dir, "--calibration", calibration_file, GRID, "-o", tmp_path / "volumes"]
    answer = told(capsys, *arguments)
    assert "belonging" in answer
    assert (answer["passed"], answer["belonging"]["verdict"]) == (True, None)
    assert "too few droplets" in answer["belonging"]["shots"][0]["problem"]
