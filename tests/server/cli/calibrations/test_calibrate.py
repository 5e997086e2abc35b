"""``tomoshadow calibrate``: what it says of a fit, and what it refuses."""

from pathlib import Path

import pytest

from processing.calibration.calibration_file import load_calibration
from server.cli.main import main
from tests.support.calibration_points import write_points
from tests.support.command_line import refused, told
from tests.support.droplet_run import SCALE_PX_PER_MM


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
    write_points(tmp_path)
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
    assert refused(capsys, *arguments) == f"{tmp_path / 'calibration.json'}: exists; only --overwrite replaces it"
    assert (tmp_path / "calibration.json").read_bytes() == before
    picture = tmp_path / "calibration-errors.png"
    picture.write_text("old")
    told(capsys, *arguments, "--overwrite")
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    "command", [["calibrate", "nowhere"], ["self-calibrate", "nowhere", "--calibration", "nowhere.json"]]
)
def test_a_calibration_that_exists_is_refused_before_anything_is_computed(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "calibration.json").write_text("kept")
    complaint = refused(capsys, *command, "-o", tmp_path / "calibration.json")
    assert complaint == f"{tmp_path / 'calibration.json'}: exists; only --overwrite replaces it"
    assert (tmp_path / "calibration.json").read_text() == "kept"


def test_origins_are_stated_for_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_points(tmp_path)
    told(capsys, "import", tmp_path / "manifest.toml", "-o", tmp_path / "set")
    arguments = ["calibrate", tmp_path / "set", "-o", tmp_path / "calibration.json", "--origin"]
    message = refused(capsys, *arguments, "view1@-4.5=812,604.5")
    assert "set.json: an imported set states its origins, rolls and mirrors itself" in message
    with pytest.raises(SystemExit):
        main([*map(str, arguments), "view1=812,604"])
    assert "not of the form VIEW@Z=U,V" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main([*map(str, arguments[:-1]), "--roll", "view1"])
    assert "not of the form VIEW=DEG" in capsys.readouterr().err
    assert "states its origins, rolls and mirrors itself" in refused(capsys, *arguments[:-1], "--roll", "view1=-90")


def test_a_refused_view_is_written_and_fails_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_points(tmp_path, noise_px=3.0)
    told(capsys, "import", tmp_path / "manifest.toml", "-o", tmp_path / "set")
    result = told(capsys, "calibrate", tmp_path / "set", "-o", tmp_path / "calibration.json", status=1)
    assert (result["passed"], result["views"]["view1"]["verdict"]) == (False, "refuse")
    assert load_calibration(tmp_path / "calibration.json").id == result["id"]
    assert main(["calibrate", str(tmp_path / "set"), "-o", str(tmp_path / "again.json")]) == 1
    output, progress = capsys.readouterr()
    error_px = result["views"]["view1"]["holdout_error_px"]
    assert f"view1: REFUSED, hold-out error {error_px:.3g} px" in progress
    heads, view1, reason, written = output.splitlines()
    assert heads == "view   verdict  hold-out [px]  points  left out  px/mm  azimuth [deg]"
    assert reason.startswith(f"view1: refuse: hold-out error {error_px:.3g} px, above 0.8 px")
    scale_px_per_mm, azimuth_deg = map(float, view1.split()[-2:])
    assert view1.split()[:4] == ["view1", "refuse", f"{error_px:.4f}", str(27 * 9)]
    assert scale_px_per_mm == pytest.approx(SCALE_PX_PER_MM, rel=0.02)
    assert azimuth_deg == pytest.approx(result["views"]["view1"]["placement"]["azimuth_deg"], abs=0.01)
    pictures = f"{tmp_path / 'again.png'}, {tmp_path / 'again-errors.png'}"
    assert written == f"{result['id']}: {tmp_path / 'again.json'}, pictures in {pictures}"
