"""Many runs by one recipe: results per run, and a run that fails stops no other."""

import json
from pathlib import Path

import pytest

from processing.reconstruction.volume_file import read_volume
from server.cli.main import main
from tests.support.command_line import GRID, refused, shown, told
from tests.support.droplet_run import write_calibration, write_run


@pytest.fixture
def day(tmp_path: Path) -> Path:
    """Two runs and their calibration."""
    for name in ("dense", "thin"):
        write_run(tmp_path / name)
    write_calibration(tmp_path / "calibration.json")
    return tmp_path


def command(day: Path, *names: str) -> list[object]:
    return ["reconstruct", *(day / name for name in names), "--calibration", day / "calibration.json"]


def test_runs_get_the_same_recipe_and_folders_of_their_own(day: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recipe = day / "minlos.toml"
    said = ["--method", "minlos", "--voxels", "uint8", f"--grid={GRID}"]
    first = told(capsys, *command(day, "dense"), "-o", day / "one", *said, "--write-recipe", recipe)
    both = told(capsys, *command(day, "dense", "thin"), "-o", day / "both", "--recipe", recipe)
    assert both["passed"] is True
    assert [(run["run"], run["out"]) for run in both["runs"]] == [
        (name, str(day / "both" / name)) for name in ("dense", "thin")
    ]
    assert {run["recipe_sha256"] for run in both["runs"]} == {first["recipe_sha256"]}
    for run in both["runs"]:
        assert (run["method"], run["voxels"], run["grid"]) == ("minlos", "uint8", first["grid"])
        volume, _, provenance = read_volume(Path(run["out"]) / run["volumes"][0]["file"])
        assert provenance["recipe_sha256"] == first["recipe_sha256"]
        assert volume.max() > 0
    text = shown(capsys, *command(day, "dense", "thin"), "-o", day / "third", "--recipe", recipe)
    assert "dense\n" in text
    assert "2 volumes by minlos" in text


def test_a_run_that_fails_is_told_and_the_others_are_done(day: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [*command(day, "dense", "none", "thin"), "-o", day / "out", f"--grid={GRID}", "--json"]
    assert main([*map(str, arguments)]) == 1
    output = capsys.readouterr()
    result = json.loads(output.out.splitlines()[-1])
    assert [run.get("passed", True) for run in result["runs"]] == [True, False, True]
    assert "none" in result["runs"][1]["error"]
    assert "Traceback" not in output.err
    assert len(result["runs"][2]["volumes"]) == 2


def test_runs_of_one_name_are_refused_as_they_would_share_a_folder(
    day: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_run(day / "other" / "thin")
    arguments = [*command(day, "thin", "other/thin"), "-o", day / "out", f"--grid={GRID}"]
    assert "two runs are called thin: their results would share a folder" in refused(capsys, *arguments)


def test_runs_of_imports_are_called_by_their_folder(day: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("monday", "tuesday"):
        write_run(day / name / "run")
    result = told(capsys, *command(day, "monday", "tuesday"), "-o", day / "out", f"--grid={GRID}")
    assert [run["run"] for run in result["runs"]] == ["monday", "tuesday"]


def test_a_recipe_and_options_are_not_both_taken(day: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recipe = day / "recipe.toml"
    recipe.write_text('schema = "tomoshadow/recipe"\nschema_version = 1\ncommand = "reconstruct"\n')
    arguments = [
        *command(day, "thin"),
        "-o",
        day / "out",
        "--recipe",
        recipe,
        "--method",
        "smart",
        "--noise-floor",
        "0",
    ]
    assert "--method, --noise-floor: " in (error := refused(capsys, *arguments))
    assert "recipe.toml says all settings" in error
    assert not (day / "out").exists()


def test_a_misspelt_key_is_named_with_its_line(day: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recipe = day / "recipe.toml"
    recipe.write_text(
        'schema = "tomoshadow/recipe"\nschema_version = 1\ncommand = "reconstruct"\n[settings]\nmetod = "smart"\n'
    )
    error = refused(capsys, *command(day, "thin"), "-o", day / "out", "--recipe", recipe)
    assert "recipe.toml, line 5: settings.metod: there is no such key here" in error
    assert "method, accuracy" in error
