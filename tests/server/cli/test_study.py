"""``tomoshadow study``: files, JSON and usage."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from processing.studies.calibration_errors import calibration_study
from processing.studies.density import DensityStudy
from processing.studies.recipe import PAPER_ITERATIONS
from processing.studies.shadows.sizes import SizeStudy
from server.cli.main import main


def test_a_study_writes_csv_and_figure_and_says_what_the_paper_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "nested" / "average"
    assert main(["study", "average", "--shots", "1", "--binning", "4", "-o", str(out), "--json"]) == 0
    output, progress = capsys.readouterr()
    result = json.loads(output.splitlines()[-1])
    assert [row["method"] for row in result["rows"]] == ["gavlos", "minlos", "mlos", "smart"]
    assert Path(result["csv"]).read_text(encoding="utf-8").startswith("method,shots,ring_mm")
    assert Path(result["profiles"]).read_text(encoding="utf-8").startswith("method,radius_mm,intensity")
    assert Path(result["figure"]).read_bytes().startswith(b"\x89PNG")
    assert [set(statement) for statement in result["statements"]] == [{"topic", "paper", "ours"}] * 2
    assert "shot 1 of 1" in progress
    assert "paper: SMART-20, then MLOS" in progress
    assert progress.endswith(f"4 rows in {result['csv']}, {result['figure']}\n")


@pytest.mark.parametrize(
    "study",
    [
        *("density", "ghosts", "average", "residuals", "calibration", "sensitivity"),
        *("droplets", "sizes", "reality", "persistence", "velocity", "tracks", "breakup", "statistics"),
    ],
)
def test_every_study_explains_itself(study: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["study", study, "--help"])
    assert stopped.value.code == 0
    assert f"study-{study}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["density", "--method", "smort"], "'smort' is none of gavlos"),
        (["density", "--sigma", "-1"], "-1 must be from 0.3 to 10 voxel"),
        (["ghosts", "--sigma", "inf"], "inf must be from 0.3 to 10 voxel"),
        (["density", "--sigma", "wide"], "'wide' is no number"),
        (["sensitivity", "--density", "inf"], "inf must be above 0, and finite"),
        (["average", "--seed", "-1"], "-1 must be 0 or more"),
        (["ghosts", "--method", "mlos-3"], "mlos does not take 3 iterations"),
        (["average", "--shots", "0"], "0 must be 1 or more"),
        (["droplets", "--views", "9"], "9: 2 to 8 views are measured"),
    ],
)
def test_bad_usage_exits_with_2_and_names_the_value(
    arguments: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["study", *arguments])
    assert stopped.value.code == 2
    assert complaint in capsys.readouterr().err


def test_a_study_that_could_not_be_written_does_not_begin(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("processing.studies.average.average_study", lambda *_: pytest.fail("the study has begun"))
    (tmp_path / "file").write_text("in the way")
    assert main(["study", "average", "-o", str(tmp_path / "file")]) == 1
    assert "file" in capsys.readouterr().err


def test_the_density_study_states_widths_windows_and_subtraction(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    small = partial(DensityStudy, shape=(64, 64, 64), counts=(10, 20), image_size_px=(128, 104))
    monkeypatch.setattr("processing.studies.density.DensityStudy", small)
    assert main(["study", "density", "--sigma", "1", "--sigma", "2", "-o", str(tmp_path), "--json"]) == 0
    output, progress = capsys.readouterr()
    result = json.loads(output.splitlines()[-1])
    assert (result["window_voxel"], result["step_voxel"], result["mean_subtracted"]) == (64, 32, True)
    assert {row["sigma_voxel"] for row in result["rows"]} == {1, 2}
    methods = list(dict.fromkeys(row["method"] for row in result["rows"]))
    assert methods == ["mlos", "minlos", "gavlos", "smart-5", "smart-10", "smart", "mart-5"]
    assert 0 < result["seconds"]["cpu"] < 60
    assert "mean-subtracted in windows of 64^3 voxel at steps of 32" in progress


def test_the_study_of_sizes_blurs_as_much_and_by_as_many_views_as_is_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    small = partial(SizeStudy, shape=(40, 24, 40), image_size_px=(120, 90), margin_voxel=5)
    monkeypatch.setattr("processing.studies.shadows.sizes.SizeStudy", small)
    stated = ["--blur", "2", "--views", "5", "--density", "20", "--repeats", "1"]
    assert main(["study", "sizes", *stated, "-o", str(tmp_path), "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out.splitlines()[-1])["rows"]
    assert row["case"] == "20/mm³, 40 um, noise 1.2 %, 5 views, aperture x 0.5"


@pytest.mark.parametrize(("drift_px", "status", "said"), [(2.0, 0, "PASSED"), (40.0, 1, "FAILED")])
def test_the_calibration_study_says_whether_all_limits_are_kept(
    drift_px: float,
    status: int,
    said: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    small = partial(
        replace,
        views=("view1",),
        z_mm=(-4.5, -1.5, 1.5, 4.5),
        fits=1,
        binning=2,
        photographs=("sharp",),
        half_mm=(2.0, 1.5, 2.0),
        drift_px=drift_px,
    )
    study = "processing.studies.calibration_errors.calibration_study"
    monkeypatch.setattr(study, lambda asked: calibration_study(small(asked)))
    assert main(["study", "calibration", "--density", "7", "-o", str(tmp_path), "--json"]) == status
    output, progress = capsys.readouterr()
    assert json.loads(output.splitlines()[-1])["passed"] is (status == 0)
    assert f"every figure within its limit: {said}" in progress


def test_help_states_the_papers_iterations(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["study", "density", "--help"])
    assert f"of smart and mart without -N, {PAPER_ITERATIONS} by default" in capsys.readouterr().out


def test_light_that_cannot_be_simulated_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["study", "sizes", "--condenser-ratio", "9", "-o", "nowhere"])
    assert "9 must be at most 8, which is light from all directions" in capsys.readouterr().err
