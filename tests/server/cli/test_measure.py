"""``tomoshadow measure``: droplets of a run in files, and bad input that gets one clear sentence."""

import html
import json
import re
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from daq.files.run_directory import DoubleFrame, ImageKey, RunHeader, RunWriter, Shot, ViewFormat
from processing.analysis.droplets.droplet_file import read_droplets
from processing.analysis.droplets.ghost_share import matches
from processing.calibration.calibration_file import load_calibration, save_calibration
from processing.calibration.calibration_record import content_id
from processing.calibration.verdict import Doubt
from processing.geometry import FloatArray
from processing.reconstruction.settings import GridSettings
from server.cli.main import main
from tests.support.bright_scenes import BOX, GRID, scene, write_bright_calibration, write_bright_run
from tests.support.command_line import refused, shown, told
from tests.support.drifting_run import rig_of, write_droplet_run
from tests.support.drifting_views import calibration_of, views
from tests.support.droplet_run import (
    DROPLETS_A_MM,
    SEEN,
    SHAPE,
    cameras,
    shadowgraph,
    write_calibration,
    write_run,
)
from tests.support.shadow_scenes import ShadowScene, shadow_scene, write_shadow_calibration, write_shadow_run


@pytest.fixture(scope="module")
def bright(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run of two double exposures and its calibration, and one of two single exposures."""
    folder = tmp_path_factory.mktemp("bright")
    write_bright_run(folder / "run", shots=2, frames=2)
    write_bright_run(folder / "single", shots=2)
    write_bright_calibration(folder / "calibration.json")
    return folder


def command(folder: Path, out: Path, *more: object, run: str = "run") -> list[object]:
    return [
        "measure", folder / run, "--calibration", folder / "calibration.json", "-o", out, f"--grid={BOX}", *more
    ]  # fmt: skip


def test_droplets_of_a_run_lie_in_files_where_they_are(
    bright: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = told(capsys, *command(bright, tmp_path / "out", "--twins", "1", "--shots", "0:1", run="single"))
    (shot,) = result["shots"]
    assert set(shot) >= {
        "shot", "droplets", "ghost_share", "ghost_interval", "residual_over_noise", "verdict", "cpu_s", "file"
    }  # fmt: skip
    assert (shot["shot"], shot["verdict"], result["polarity"]) == (0, "good", "bright")
    unchecked, lengths, depth, faint, height = result["not_checked"]
    assert re.search(r"droplets fainter than 0\.0\d+ of full scale", faint["what"])
    assert "whether all views still look where they did at the target" in height["what"]
    assert "seen by the same lenses at the same focus" in lengths["what"]
    assert "sights hardly diverge in this volume" in depth["what"]
    assert "in proportion to light: any gamma fits bright particles" in unchecked["what"]
    assert unchecked["state"] == "gamma 1 in the settings of the cameras"
    assert shot["ghost_share"] < 0.03
    assert shot["ghost_interval"][0] <= shot["ghost_share"] <= shot["ghost_interval"][1]
    assert shot["ghost_reason"] is None
    assert shot["twin_ghost_share"] < 0.03
    assert result["statistics"]["ghost_share"]["value"] == pytest.approx(shot["ghost_share"])
    stored = read_droplets(tmp_path / "out" / shot["file"])
    assert {len(column) for column in stored.columns.values()} == {shot["droplets"]}
    first = stored.columns["frame"] == "a"
    points_mm = np.column_stack([stored.columns[f"{axis}_mm"][first] for axis in "xyz"])
    truth = scene()
    of_found, of_truth = matches(points_mm, truth.points_mm, GRID.pitch_mm)
    assert np.mean(of_truth >= 0) > 0.97
    assert np.mean(of_found < 0) < 0.03
    amplitudes = stored.columns["amplitude"][first][of_found >= 0] * 4095 / 400
    assert np.median(amplitudes / truth.heights[of_found[of_found >= 0]]) == pytest.approx(1, abs=0.02)
    density = result["statistics"]["number_density_per_mm3"]
    assert density["low"] < density["value"] < density["high"]
    assert result["statistics"]["n"] == shot["droplets"]
    assert result["statistics"]["d32_um"] is None
    assert "bright particles have no diameter" in result["statistics"]["reason"]


def test_statistics_and_report_tell_once_what_nothing_checks_of_the_shots(
    bright: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of two shots, wherever their files lie, with run and calibration out of reach."""
    measured = told(capsys, *command(bright, tmp_path / "out", run="single"))
    pooled = told(capsys, "statistics", tmp_path / "out")
    assert len(measured["not_checked"]) == 5
    assert [one for one in pooled["not_checked"] if one in measured["not_checked"]] == measured["not_checked"]
    text = shown(capsys, "statistics", tmp_path / "out")
    told(capsys, "report", tmp_path / "out", "-o", tmp_path / "report.html")
    page = html.unescape((tmp_path / "report.html").read_text())
    for one in measured["not_checked"]:
        assert (text.count(one["what"]), page.count(one["what"])) == (1, 1)


def test_a_file_says_where_it_comes_from_and_what_each_column_is(
    bright: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = told(capsys, *command(bright, tmp_path / "out", "--shots", "1:2"))
    (shot,) = result["shots"]
    assert (shot["ghost_share"] is not None, shot["twin_ghost_share"]) == (True, None)
    with h5py.File(tmp_path / "out" / shot["file"]) as file:
        columns = file["droplets"]
        assert {column.ndim for column in columns.values()} == {1}
        assert columns["x_mm"].attrs["units"] == "mm"
        assert columns["cov_xz_mm2"].attrs["units"] == "mm^2"
        assert columns["p_real"].attrs["reason"].startswith("not a number where it was not tried")
        assert np.median(columns["p_real"][:]) > 0.99
        attributes = dict(file["tomoshadow"].attrs)
    assert (attributes["schema"], attributes["schema_version"]) == ("tomoshadow/droplets", 3)
    assert (attributes["run"], attributes["shot"]) == ("run", 1)
    exposures = json.loads(attributes["exposures"])
    assert list(exposures) == ["a", "b"]
    assert set(exposures["a"]["views"]) == {"view1", "view2", "view3", "view4"}
    assert exposures["a"]["verdict"] == "good"
    assert GridSettings.model_validate_json(attributes["grid"]).model_dump(mode="json") == result["grid"]


def test_exposures_that_show_the_same_droplets_make_their_density_no_surer(
    bright: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    widths = []
    for run in ("single", "run"):
        statistics = told(capsys, *command(bright, tmp_path / run, "--shots", "0:1", run=run))["statistics"]
        density = statistics["number_density_per_mm3"]
        widths.append((density["high"] - density["low"]) / density["value"])
    assert widths[1] == pytest.approx(widths[0], rel=0.03)


def test_droplets_are_exported_beside_their_file_and_not_over_another(
    bright: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "shot_00000_droplets.csv").write_text("mine")
    arguments = command(bright, tmp_path / "out", "--shots", "0:1", "--export", "csv,vtk", run="single")
    assert "shot_00000_droplets.csv: exists" in refused(capsys, *arguments)
    (tmp_path / "out" / "shot_00000_droplets.csv").unlink()
    (shot,) = told(capsys, *arguments)["shots"]
    rows = (tmp_path / "out" / "shot_00000_droplets.csv").read_text().splitlines()
    assert len(rows) == shot["droplets"] + 1
    assert (tmp_path / "out" / "shot_00000_droplets.vtkhdf").is_file()


def test_formats_that_are_not_there_are_refused_before_anything_is_measured(
    bright: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(SystemExit):
        main([*map(str, command(bright, tmp_path / "out", "--export", "csv,xlsx"))])
    assert "formats are csv, vtk, parquet, tecplot, with commas between them" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert "pip install 'tomoshadow[tables]'" in refused(
        capsys, *command(bright, tmp_path / "out", "--export", "parquet")
    )
    assert not (tmp_path / "out").exists()


def test_twins_beyond_their_limit_are_refused_in_a_sentence(
    bright: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main([*map(str, command(bright, tmp_path / "out", "--twins", "101"))])
    assert "--twins: 101: Input should be less than or equal to 100" in capsys.readouterr().err


def test_the_recipe_that_was_written_measures_the_same(
    bright: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recipe = tmp_path / "recipe.toml"
    first = told(capsys, *command(bright, tmp_path / "one", "--shots", "0:1", "--write-recipe", recipe, run="single"))
    by_recipe = ["measure", bright / "single", "--calibration", bright / "calibration.json", "--recipe", recipe]
    again = told(capsys, *by_recipe, "-o", tmp_path / "two", "--shots", "0:1")
    assert again["recipe_sha256"] == first["recipe_sha256"]
    one, two = (read_droplets(tmp_path / name / "shot_00000_droplets.h5") for name in ("one", "two"))
    assert two.provenance == one.provenance
    assert len(str(one.provenance["images"])) == 32, "a hash, by which the same shot of another import is known"
    assert one.provenance["recipe_sha256"] == first["recipe_sha256"]
    for name, column in one.columns.items():
        np.testing.assert_array_equal(two.columns[name], column, name)
    assert "recipe.toml: exists" in refused(capsys, *by_recipe, "-o", tmp_path / "three", "--write-recipe", recipe)
    assert "--twins: " in refused(capsys, *by_recipe, "-o", tmp_path / "three", "--twins", "0")


def test_what_exists_is_replaced_only_when_asked(
    bright: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = command(bright, tmp_path / "out", "--shots", "0:1", run="single")
    assert "in 1 exposure" in shown(capsys, *arguments)
    assert "exists; only --overwrite replaces it" in refused(capsys, *arguments)
    told(capsys, *command(bright, tmp_path / "out", "--shots", "1:2", run="single"))
    told(capsys, *arguments, "--overwrite")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["settings.json", "shot_00000_droplets.h5"]


def test_a_covered_view_is_refused_and_the_command_fails(
    bright: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_dir = write_bright_run(tmp_path / "run", covered=("view3",))
    calibration = bright / "calibration.json"
    arguments = ["measure", run_dir, "--calibration", calibration, "-o", tmp_path / "out", f"--grid={BOX}", "--json"]
    assert main([*map(str, arguments)]) == 1
    output = capsys.readouterr()
    assert "shot 0: refused: view3 sees nothing while the others see droplets" in output.err
    result = json.loads(output.out.splitlines()[-1])
    assert result["shots"][0]["droplets"] == 0
    assert result["statistics"]["number_density_per_mm3"] is None
    assert result["statistics"]["number_density_reason"] == "no exposure could be measured"


def shadow_run(folder: Path, *, background: bool = True) -> tuple[ShadowScene, list[object]]:
    """A run of shadows with its truth, and the command that measures it."""
    shot = shadow_scene((120, 24, 200), 14, (280, 80))
    run_dir = write_shadow_run(folder / "run", shot, background=background)
    calibration = write_shadow_calibration(folder / "calibration.json", shot)
    low_mm, high_mm = (shot.grid.to_mm(np.array([index])).ravel() for index in (np.zeros(3), np.array([119, 23, 199])))
    box = ",".join(f"{low}:{high}" for low, high in zip(low_mm, high_mm, strict=True))
    return shot, ["measure", run_dir, "--calibration", calibration, "-o", folder / "out", f"--grid={box}"]


def test_shadows_of_a_run_become_droplets_with_diameters(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shot, arguments = shadow_run(tmp_path)
    result = told(capsys, *arguments)
    assert (result["polarity"], result["shots"][0]["verdict"]) == ("shadow", "good")
    gamma, lamps, opaque, _lengths, _depth, _height = (one["what"] for one in result["not_checked"])
    assert "a gamma near to 1 fits shadows" in gamma
    assert "black is where the dark image says so" in gamma
    assert "whether all views are in the same light" in lamps
    assert "whether droplets are opaque alike" in opaque
    stored = read_droplets(tmp_path / "out" / result["shots"][0]["file"])
    points_mm = np.column_stack([stored.columns[f"{axis}_mm"] for axis in "xyz"])
    of_found, of_truth = matches(points_mm, shot.points_mm, shot.grid.pitch_mm)
    large = shot.diameters_mm > 0.02
    assert np.mean(of_truth[large] >= 0) >= 0.95
    assert np.mean(of_found < 0) <= 0.03
    real = of_found >= 0
    errors_um = stored.columns["diameter_um"][real] - 1000 * shot.diameters_mm[of_found[real]]
    assert np.median(np.abs(errors_um)) < 0.4
    np.testing.assert_array_equal(stored.columns["diameter_um"], stored.columns["diameter_raw_um"])
    d32_um = result["statistics"]["d32_um"]
    assert d32_um["low"] < d32_um["value"] < d32_um["high"]
    true_d32_um = 1000 * np.sum(shot.diameters_mm**3) / np.sum(shot.diameters_mm**2)
    assert d32_um["value"] == pytest.approx(true_d32_um, rel=0.03)
    with h5py.File(tmp_path / "out" / result["shots"][0]["file"]) as file:
        assert file["droplets"]["diameter_um"].attrs["units"] == "um"
        assert "blur is Gaussian" in file["droplets"]["diameter_um"].attrs["correction"]
        assert "amplitude" not in file["droplets"]
        assert file["tomoshadow"].attrs["schema_version"] == 3


def test_a_shot_among_its_own_backgrounds_is_doubtful(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its diameters are a twentieth too small, and its droplets look like any."""
    shot = shadow_scene((40, 30, 80), 28, (160, 90))
    run_dir = write_shadow_run(tmp_path / "run", shot, seen_behind=[1 - (1 - image) / 4 for image in shot.images])
    calibration = write_shadow_calibration(tmp_path / "calibration.json", shot)
    (told_shot,) = told(
        capsys, "measure", run_dir, "--calibration", calibration, "-o", tmp_path / "out", "--light", "gaussian"
    )["shots"]
    assert told_shot["verdict"] == "doubtful"
    for number in range(1, 5):
        assert f"view{number} has 2" in told_shot["reasons"][number - 1]
        assert "% of its own shadows in its background" in told_shot["reasons"][number - 1]


def write_noiseless_run(run_dir: Path, droplets_mm: FloatArray, shots: int = 1) -> Path:
    views = cameras()
    header = RunHeader(
        run_id="run",
        created_utc="2026-01-01T00:00:00+00:00",
        views={name: ViewFormat(SHAPE, 8) for name in views},
        frames_per_shot=1,
        polarity="shadow",
    )
    images = {name: DoubleFrame(shadowgraph(camera, droplets_mm), None, SEEN, SEEN) for name, camera in views.items()}
    with RunWriter(run_dir, header) as writer:
        light = np.full((1, *SHAPE), 200, np.float32)
        writer.write_references(dict.fromkeys(views, 0 * light), dict.fromkeys(views, light))
        for index in range(shots):
            writer.write_shot(Shot(index, ImageKey.SAMPLE, images))
        writer.finish("completed")
    return run_dir


def test_shadows_without_any_noise_are_measured(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of a simulation, or where all light is saturated: what is left has no noise to divide by."""
    run_dir = write_noiseless_run(tmp_path / "run", DROPLETS_A_MM)
    calibration = write_calibration(tmp_path / "calibration.json")
    box = "--grid=-2:2,-2:2,-2:2"
    result = told(capsys, "measure", run_dir, "--calibration", calibration, box, "-o", tmp_path / "out")
    assert result["shots"][0]["droplets"] == len(DROPLETS_A_MM)


def test_a_shot_that_is_a_copy_of_another_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    apart_mm = np.array([[0, 0, 0], [0, 0.6, 0], [0, -0.7, 0]])
    run_dir = write_noiseless_run(tmp_path / "run", np.vstack([DROPLETS_A_MM + one for one in apart_mm]), shots=2)
    calibration = write_calibration(tmp_path / "calibration.json")
    box = "--grid=-2:2,-2:2,-2:2"
    result = told(capsys, "measure", run_dir, "--calibration", calibration, box, "-o", tmp_path / "out")
    assert result["copies"] == ["run, shot 1 has the very droplets of run, shot 0: one is a copy"]


def test_images_that_are_mirrored_in_all_views_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """All lines of sight nearly meet: depth is reversed, and only perspective tells."""
    run_dir = write_droplet_run(tmp_path / "run", drift_px=0, mirrored=True)
    save_calibration(calibration_of(views()), tmp_path / "calibration.json")
    arguments = ["measure", run_dir, "--calibration", tmp_path / "calibration.json", "--shots", "0:1"]
    result = told(capsys, *arguments, "--grid=-1:1,-0.5:0.5,-1:1", "-o", tmp_path / "out", status=1)
    (shot,) = result["shots"]
    assert shot["verdict"] == "refused"
    assert "if all images are mirrored left to right, or turned by 180 degrees" in shot["reasons"][0]
    assert shot["reasons"][0].endswith("depth is reversed")
    (told_of_all,) = result["depth"]
    assert told_of_all.startswith("all shots together: all views agree on ")


def test_droplets_in_another_scale_than_that_of_the_rig_are_doubtful(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = [f"view{number}" for number in range(1, 5)]
    write_bright_run(tmp_path / "run", configuration=rig_of(names, 0.22))
    write_bright_calibration(tmp_path / "calibration.json")
    result = told(capsys, *command(tmp_path, tmp_path / "out"))
    (shot,) = result["shots"]
    assert shot["verdict"] == "doubtful"
    assert not any("same lenses" in one["what"] for one in result["not_checked"])
    assert "29.7 px/mm by magnification and pixels of the rig: is the calibration that of another" in shot["reasons"][0]


def test_droplets_placed_by_a_calibration_that_doubts_itself_are_doubtful(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A target in another unit than was stated: all views agree, and all lengths are wrong."""
    write_bright_run(tmp_path / "run")
    write_bright_calibration(tmp_path / "sure.json")
    calibration = load_calibration(tmp_path / "sure.json")
    doubted = calibration.doubted([Doubt(tuple(calibration.views), "is pitch_mm right?")])
    save_calibration(doubted.with_id(content_id(doubted)), tmp_path / "calibration.json")
    (shot,) = told(capsys, *command(tmp_path, tmp_path / "out"))["shots"]
    assert shot["verdict"] == "doubtful"
    assert shot["reasons"][0].endswith("says so itself, view1: warn: is pitch_mm right?")


def test_few_droplets_do_not_tell_near_from_far_and_that_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_dir = write_droplet_run(tmp_path / "run", density_per_mm3=0.3, drift_px=0, shots=1)
    save_calibration(calibration_of(views()), tmp_path / "calibration.json")
    arguments = ["measure", run_dir, "--calibration", tmp_path / "calibration.json", "-o", tmp_path / "out"]
    result = told(capsys, *arguments, "--grid=-3.5:3.5,-3:3,-2.5:2.5")
    assert any("droplets are too few to tell it, and near and far" in one["what"] for one in result["not_checked"])
    assert result["depth"] == []


def test_shadows_without_a_background_are_refused_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, arguments = shadow_run(tmp_path, background=False)
    assert "view1 has no background, and without one nobody knows how much light" in refused(capsys, *arguments)
    assert not (tmp_path / "out").exists()


def test_a_run_is_measured_as_it_is_recorded(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run_dir, calibration = write_run(tmp_path / "run"), write_calibration(tmp_path / "calibration.json")
    arguments = ["measure", run_dir, "--calibration", calibration, "-o", tmp_path / "out"]
    assert "recorded as shadow, they are not measured as bright" in refused(capsys, *arguments, "--polarity", "bright")
    assert not (tmp_path / "out").exists()


def test_a_file_that_has_no_droplets_is_named(tmp_path: Path) -> None:
    from processing.analysis.droplets.droplet_file import DropletFileError

    path = tmp_path / "none.h5"
    with pytest.raises(DropletFileError, match=r"none\.h5: not a readable file of droplets"):
        read_droplets(path)
    path.write_bytes(b"no HDF5")
    with pytest.raises(DropletFileError, match=r"none\.h5"):
        read_droplets(path)
