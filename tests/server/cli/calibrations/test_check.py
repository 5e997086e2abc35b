"""check and self-calibrate: a camera that moved after calibration is told from the shots, and put right."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from processing.calibration.calibration_file import load_calibration, save_calibration
from processing.calibration.calibration_record import content_id
from processing.calibration.droplets.disparity import ViewDisparity
from processing.calibration.fit.not_checked import DROPLETS
from processing.calibration.verdict import Doubt, Verdict
from processing.runs.run_check import checked_by_run
from processing.runs.shots.shot_check import ShotCheck
from server.cli.calibrations.check import check_line, views_table
from tests.support.command_line import refused, told
from tests.support.drifting_run import DRIFT_PX, write_droplet_run
from tests.support.drifting_views import calibration_of, inside_mm, views
from tests.support.droplet_run import write_run

GRID = "--grid=-1:1,-1:1,-1:1@0.1"


@pytest.fixture(scope="module")
def run_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_droplet_run(tmp_path_factory.mktemp("runs") / "droplets")


@pytest.fixture
def calibration_file(tmp_path: Path) -> Path:
    save_calibration(calibration_of(views()), tmp_path / "old.json")
    return tmp_path / "old.json"


@pytest.mark.parametrize(("magnification", "verdict"), [(0.45, "good"), (0.9, "warn")])
def test_a_calibration_in_another_scale_than_the_rig_is_an_alarm(
    calibration_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    magnification: float,
    verdict: str,
) -> None:
    """A factor of all lengths moves no view: another lens, or another focus, and droplets agree all the same."""
    run_dir = write_droplet_run(tmp_path / "run", drift_px=0, shots=1, magnification=magnification)
    result = told(capsys, "check", run_dir, "--calibration", calibration_file)
    assert result["verdict"] == verdict
    (shot,) = result["shots"]
    assert max(shot["views"].values()) < 0.2
    assert ("is the calibration that of another lens" in str(shot["problem"])) == (verdict == "warn")


@pytest.mark.parametrize("command", ["check", "reconstruct"])
def test_what_a_calibration_says_against_itself_is_told_where_it_is_used(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its droplets agree: no droplet tells a wrong pitch of the target."""
    calibration = calibration_of(views()).doubted([Doubt(("view2",), "is pitch_mm right?")])
    save_calibration(calibration.with_id(content_id(calibration)), tmp_path / "doubted.json")
    run_dir = write_droplet_run(tmp_path / "run", drift_px=0, shots=1)
    made = [] if command == "check" else [GRID, "-o", tmp_path / "out"]
    result = told(capsys, command, run_dir, "--calibration", tmp_path / "doubted.json", *made)
    answer = result if command == "check" else result["belonging"]
    assert answer["verdict"] == "warn"
    assert answer["shots"][0]["problem"].endswith("says so itself, view2: warn: is pitch_mm right?")


def test_moved_view_stops_and_a_corrected_calibration_is_good_again(
    run_dir: Path, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = told(capsys, "check", run_dir, "--calibration", calibration_file, status=1)
    assert before["passed"] is False
    assert (before["verdict"], before["alarm_px"], before["stop_px"]) == ("refuse", 0.3, 0.8)
    assert [shot["shot"] for shot in before["shots"]] == [0, 1]
    for shot in before["shots"]:
        assert shot["views"]["view2"] == pytest.approx(DRIFT_PX, abs=0.15)
        assert 0 < shot["uncertainty_px"]["view2"] < 0.1

    new = tmp_path / "new.json"
    result = told(capsys, "self-calibrate", run_dir, "--calibration", calibration_file, "-o", new)
    assert result["moved"] == "view2"
    assert result["views"]["view2"]["correction_px"] == pytest.approx(DRIFT_PX, abs=0.15)
    assert result["views"]["view1"]["correction_px"] == 0
    calibration = load_calibration(new)
    assert (calibration.parent, calibration.id) == (result["parent"], result["id"])
    assert result["parent"] == load_calibration(calibration_file).id
    points_mm = inside_mm()
    error_px = calibration.views["view2"].mapping.project(points_mm) - views()[1].project(points_mm) - (DRIFT_PX, 0)
    assert np.linalg.norm(error_px, axis=1).max() < 0.1

    after = told(capsys, "check", run_dir, "--calibration", new, "--shots", "1:2")
    assert [shot["shot"] for shot in after["shots"]] == [1]
    assert max(after["shots"][0]["views"].values()) < 0.2
    assert after["verdict"] in ("good", "usable")
    assert after["passed"] is True


@pytest.mark.parametrize("cut_px", [0, 8], ids=["of a rig", "from elsewhere"])
def test_rows_that_were_cut_alike_in_all_views_are_not_checked(
    cut_px: int, calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Droplets agree whether they are where they seem to be or not."""
    run_dir = write_droplet_run(tmp_path / "run", drift_px=0, shots=1, cut_px=cut_px)
    arguments = (run_dir, "--calibration", calibration_file)
    checked = told(capsys, "check", *arguments)
    made = told(capsys, "reconstruct", *arguments, GRID, "-o", tmp_path / "out")["belonging"]
    for answer in (checked, made):
        assert answer["verdict"] == "good"
        why = "rows were cut elsewhere" if cut_px else "a frame with all cameras that sank"
        assert any(why in one["what"] for one in answer["not_checked"])


def test_shots_of_few_droplets_tell_together_that_depth_is_reversed(
    calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each by itself finds that views agree."""
    run_dir = write_droplet_run(tmp_path / "run", 0.4, drift_px=0, shots=3, mirrored=True)
    checked = told(capsys, "check", run_dir, "--calibration", calibration_file, status=1)
    assert {shot["verdict"] for shot in checked["shots"]} <= {"good", "usable", None}
    assert (checked["passed"], checked["verdict"]) == (False, "refuse")
    (depth,) = checked["depth"]
    assert depth.startswith("all shots together: all views agree on ")
    assert depth.endswith("depth is reversed")


@pytest.mark.parametrize("command", ["check", "reconstruct", "average"])
def test_images_of_another_size_than_those_of_the_target_are_refused(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_dir, calibration_file = write_run(tmp_path / "run"), tmp_path / "calibration.json"
    save_calibration(calibration_of(views()[:3]), calibration_file)
    more = [] if command == "check" else [GRID, "-o", tmp_path / "out"]
    complaint = refused(capsys, command, run_dir, "--calibration", calibration_file, *more)
    assert "view1: image of 160 x 120 px, calibrated for 400 x 300 px" in complaint


def test_droplets_are_part_of_the_verdict_of_a_calibration(
    run_dir: Path, calibration_file: Path, tmp_path: Path
) -> None:
    fitted = replace(load_calibration(calibration_file), not_checked=(DROPLETS,))
    checked = checked_by_run(fitted, run_dir)
    assert checked.not_checked == ()
    assert {name: view.verdict for name, view in checked.views.items() if view.reasons} == {"view2": "refuse"}
    (reason,) = checked.views["view2"].reasons
    assert reason.startswith("shot 0 of run droplets: droplets are seen ")
    assert reason in checked.notes
    assert checked.id != fitted.id
    empty = write_droplet_run(tmp_path / "empty", density_per_mm3=0.05)
    silent = checked_by_run(fitted, empty)
    assert (silent.views, silent.not_checked) == (fitted.views, (DROPLETS,))
    assert silent.notes[-1].startswith("run empty does not tell: ")


def test_shots_without_droplets_say_so_and_correct_nothing(
    calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    empty = write_droplet_run(tmp_path / "empty", density_per_mm3=0.05)
    result = told(capsys, "check", empty, "--calibration", calibration_file)
    assert result["verdict"] is None
    assert result["shots"][0]["views"] == {}
    assert "too few droplets" in result["shots"][0]["problem"]
    new = tmp_path / "new.json"
    refused = told(capsys, "self-calibrate", empty, "--calibration", calibration_file, "-o", new, status=2)
    assert "sub-volumes, 8 are needed" in refused["error"]
    assert not new.exists()


def test_a_view_that_sees_no_droplet_is_named(
    calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = write_droplet_run(tmp_path / "covered", covered="view3")
    blind = (
        r"^view3: no droplet is seen \(droplets in \d exposures: view1 \d+, view2 \d+, view3 0, view4 \d+\); is a lens"
    )
    problem = told(capsys, "check", run, "--calibration", calibration_file, "--shots", "0:1")["shots"][0]["problem"]
    assert re.match(blind, problem)
    new = tmp_path / "new.json"
    refused = told(capsys, "self-calibrate", run, "--calibration", calibration_file, "-o", new, status=2)
    assert re.match(blind, refused["error"])


def test_droplets_of_two_fields_of_video_are_no_good_witnesses(
    calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each is seen in all views at once, so that lines of sight meet; their places and numbers are of no time."""
    woven = write_droplet_run(tmp_path / "woven", drift_px=0, interlaced=True, shots=1)
    result = told(capsys, "check", woven, "--calibration", calibration_file)
    assert result["shots"][0]["verdict"] in ("good", "usable")
    assert result["verdict"] == "warn"
    assert "exposure a: view1 has rows that alternate" in result["shots"][0]["odd_light"][0]
    fine = write_droplet_run(tmp_path / "fine", drift_px=0, shots=1)
    result = told(capsys, "check", fine, "--calibration", calibration_file)
    assert (result["verdict"], result["shots"][0]["odd_light"]) == ("good", [])


def test_calibration_of_other_views_is_refused(
    calibration_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = write_droplet_run(tmp_path / "other", density_per_mm3=0.05, view_count=3)
    refused = told(capsys, "check", other, "--calibration", calibration_file, status=2)
    assert "run other has views ['view1', 'view2', 'view3'], calibration cal-" in refused["error"]


def test_a_view_out_of_range_is_told_without_a_figure() -> None:
    measured = ShotCheck(3, {}, "view2 has moved further than 3 px", ("view2",))
    assert check_line(measured) == (
        "shot 3: view2 has moved further than 3 px  STOP: do not reconstruct with this calibration"
    )
    told = measured.record()
    assert (told["verdict"], told["moved"], told["views"]) == ("refuse", "view2", {})
    assert told["problem"] == "view2 has moved further than 3 px"


@pytest.mark.parametrize(
    ("disparity_px", "verdict", "ending"),
    [(0.2, Verdict.USABLE, "px"), (0.4, Verdict.WARN, "ALARM"), (0.9, Verdict.REFUSE, "with this calibration")],
)
def test_limits_are_told(disparity_px: float, verdict: Verdict, ending: str) -> None:
    measured = ShotCheck(3, {"view1": ViewDisparity(0.01, 0.01), "view2": ViewDisparity(disparity_px, 0.02)})
    assert measured.verdict is verdict
    assert check_line(measured).startswith(f"shot 3: view1 0.01 ± 0.01 px, view2 {disparity_px:.2f} ± 0.02 px")
    assert check_line(measured).endswith(ending)


def test_people_get_a_line_per_view() -> None:
    shots = [{"views": {"view1": 0.1, "view2": px}} for px in (0.25, 0.35, 0.95)]
    result = {"shots": [*shots, {"views": {}}], "verdict": "refuse", "alarm_px": 0.3, "stop_px": 0.8}
    assert views_table(result).splitlines() == [
        "view   median [px]  largest [px]",
        "view1         0.10          0.10",
        "view2         0.35          0.95",
        "3 of 4 shots tell: refuse; alarm above 0.3 px, stop above 0.8 px",
    ]
    silent = {**result, "shots": [{"views": {}}], "verdict": None}
    assert views_table(silent) == "0 of 1 shot tell: no verdict; alarm above 0.3 px, stop above 0.8 px"
