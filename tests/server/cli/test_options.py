"""What several commands are told: grids, shots, pictures and processors."""

import os
import re
from argparse import Namespace
from pathlib import Path

import pytest

from processing.calibration.calibration_file import load_calibration
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.settings import GridSettings, ReconstructionSettings
from processing.runs.errors import PipelineError
from processing.runs.stated_grid import parse_grid
from server.cli.main import main
from server.cli.options import reconstruction_settings
from tests.support.command_line import GRID, refused, told


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
    assert parse_grid(grid, calibration) == parse_grid(GRID, calibration)


@pytest.mark.parametrize("grid", ["0:1,0:1,0:1e999", "0:1,0:1,0:e0", "0:1,0:1,0:.", "0:nan,0:1,0:1", "0:1,0:1,0:1@0x1"])
def test_a_grid_of_other_words_is_named(grid: str, calibration_file: Path) -> None:
    with pytest.raises(PipelineError, match=re.escape(f"--grid {grid!r} is not of the form X0:X1")):
        parse_grid(grid, load_calibration(calibration_file))


@pytest.mark.parametrize("grid", ["-.001:.001,-.001:.001,-.001:.001@1e-4", "-1:1,-1:1,5:6@0.1"])
def test_a_grid_in_another_unit_or_elsewhere_is_asked_about(
    grid: str, run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["reconstruct", str(run_dir), "--calibration", str(calibration_file), "--shots", "0:1"]
    assert main([*arguments, f"--grid={grid}", "-o", str(tmp_path / "out")]) == 0
    assert "of the calibrated volume: is it in mm, and where the target was?" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["1,234.5", "4,5", "four", "1_0", "\u0664"])
def test_what_is_no_number_is_told_in_words(text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["measure", str(tmp_path / "a.png"), "-o", str(tmp_path / "out"), "--um-per-px", text])
    assert f"--um-per-px: {text!r} is no number: a point stands before decimals" in capsys.readouterr().err


@pytest.mark.parametrize("option", [["--twins", "1_0"], ["--light", "0.1_0"]])
def test_digits_of_programmers_are_no_number(
    option: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(["measure", str(tmp_path), "--calibration", str(tmp_path), "-o", str(tmp_path / "out"), *option])
    assert f"{option[0]}: {option[1]!r} is no number" in capsys.readouterr().err


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


@pytest.mark.parametrize(
    ("command", "work"), [("reconstruct", "pipeline.reconstruct_shots"), ("average", "run_average.average_run")]
)
def test_a_command_takes_the_processors_that_it_may_use(
    command: str,
    work: str,
    run_dir: Path,
    calibration_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def tell(*_: object, threads: int, **__: object) -> None:
        raise PipelineError(f"{threads} threads")

    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 2, 5})
    monkeypatch.setattr(f"processing.runs.volumes.{work}", tell)
    arguments = [command, run_dir, "--calibration", calibration_file, f"--grid={GRID}", "-o", tmp_path / "out"]
    assert refused(capsys, *arguments) == "3 threads"


@pytest.mark.parametrize("name", ["accuracy", "voxels", "iterations", "relaxation", "least_gain", "minimum_window_px"])
def test_an_option_says_what_the_setting_of_its_name_says(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Help does without the settings, which are slow to load."""
    with pytest.raises(SystemExit):
        main(["reconstruct", "--help"])
    options = " ".join(capsys.readouterr().out.split()).partition(" options: ")[2]
    said, *_ = options.partition(f" --{name.replace('_', '-')} ")[2].split(" --")
    assert said.endswith(f" {ReconstructionSettings.model_fields[name].description}")


def test_what_is_not_said_is_left_to_the_settings(calibration_file: Path) -> None:
    options = Namespace(method="smart", accuracy=None, voxels=None, iterations=7, relaxation=None, least_gain=None)
    options.minimum_window_px, options.noise_floor = None, 0.02
    options.grid = GRID
    calibration = load_calibration(calibration_file)
    settings = reconstruction_settings(options, calibration)
    grid = GridSettings.of(parse_grid(GRID, calibration))
    assert settings == ReconstructionSettings(
        method=ReconstructionMethod.SMART, iterations=7, noise_floor=0.02, grid=grid
    )
