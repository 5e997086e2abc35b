"""reconstruct and average ask droplets whether run and calibration belong together: volumes look fine either way."""

import json
from pathlib import Path

import pytest

from processing.calibration.calibration_file import save_calibration
from processing.reconstruction.volume_file import read_volume
from processing.runs.shots.meeting_lines import SeldomMeeting
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


def test_no_shot_stands_out_where_all_are_alike_or_droplets_few() -> None:
    for counts in ({}, {0: 0, 1: 0}, {0: 9, 1: 0}, {0: 30, 1: 18, 2: 40, 3: 31}, dict.fromkeys(range(9), 50)):
        assert SeldomMeeting(None, counts).shots() == []
    assert SeldomMeeting(None, {0: 30, 1: 12, 2: 40, 3: 31, 4: 2}).shots() == [4, 1]


def test_what_droplets_do_not_tell_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run_dir, calibration_file = write_run(tmp_path / "run"), write_calibration(tmp_path / "calibration.json")
    arguments = ["reconstruct", run_dir, "--calibration", calibration_file, GRID, "-o", tmp_path / "volumes"]
    answer = told(capsys, *arguments)
    assert "belonging" in answer
    assert (answer["passed"], answer["belonging"]["verdict"]) == (True, None)
    assert "too few droplets" in answer["belonging"]["shots"][0]["problem"]
