"""Runs that came from elsewhere, and not whole: what is missing, renamed or another run's is told."""

import json
from pathlib import Path

import h5py
import pytest

from daq.files.run_directory import RunReader
from server.cli.main import main
from tests.support.command_line import GRID, refused, told
from tests.support.droplet_run import write_calibration, write_run


@pytest.fixture
def run_dir(tmp_path: Path) -> Path:
    """A completed run of three shots; its calibration beside it."""
    write_calibration(tmp_path / "calibration.json")
    return write_run(tmp_path / "run", 3)


def command(run_dir: Path) -> list[object]:
    place = run_dir.parent
    return ["reconstruct", run_dir, "--calibration", place / "calibration.json", f"--grid={GRID}", "-o", place / "out"]


def without_outcome(run_dir: Path) -> None:
    with h5py.File(run_dir / "run.h5", "r+") as file:
        for name in ("outcome", "cause", "end_time", "shot_count"):
            file["entry"].pop(name, None)


def test_the_last_shot_that_was_not_copied_is_missed(run_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (run_dir / "shots" / "2.h5").unlink()
    assert RunReader(run_dir).shot_count == 3
    assert "shots/2.h5: cannot be read" in refused(capsys, *command(run_dir))
    assert len(told(capsys, *command(run_dir), "--shots", "0:2")["volumes"]) == 4


def test_a_shot_under_the_name_of_another_is_refused(run_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (run_dir / "shots" / "2.h5").replace(run_dir / "shots" / "1.h5")
    assert "shots/1.h5: holds shot 2, and is named otherwise" in refused(capsys, *command(run_dir), "--shots", "0:2")


def test_two_runs_of_one_name_do_not_share_results(run_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told(capsys, *command(run_dir), "--shots", "0:1")
    began = "2026-02-01T00:00:00+00:00"
    with h5py.File(run_dir / "run.h5", "r+") as file:
        del file["entry/created_utc"]
        file["entry/created_utc"] = json.dumps(began)
    assert "of another run of this name" in refused(capsys, *command(run_dir), "--shots", "1:2")
    with h5py.File(run_dir / "shots" / "1.h5", "r+") as file:
        file.attrs["run_created_utc"] = began
    assert "holds results of another run" in refused(capsys, *command(run_dir), "--shots", "1:2")


def test_results_of_before_go_on(run_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told(capsys, *command(run_dir), "--shots", "0:1")
    record = run_dir.parent / "out" / "settings.json"
    written = json.loads(record.read_text())
    del written["run_created_utc"]
    record.write_text(json.dumps(written))
    assert len(told(capsys, *command(run_dir), "--shots", "1:2")["volumes"]) == 2


def test_a_run_that_is_not_complete_says_so(run_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    without_outcome(run_dir)
    arguments = [str(one) for one in (*command(run_dir), "--shots", "0:1")]
    assert main(arguments) == 0
    assert "run: has no outcome: it was interrupted, or is still being recorded" in capsys.readouterr().err
