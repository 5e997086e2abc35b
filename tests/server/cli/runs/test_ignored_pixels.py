"""``tomoshadow measure --ignore``: a nozzle in one view harms no droplet, and nobody takes it for one."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import read_droplets
from processing.analysis.droplets.ghost_share import matches
from processing.runs.errors import PipelineError
from processing.runs.measured_images import require_fitting, without_ignored
from server.cli.main import main
from tests.support.bright_scenes import BOX, write_bright_calibration, write_bright_run
from tests.support.command_line import refused, told
from tests.support.shadow_scenes import ShadowScene, shadow_scene, write_shadow_calibration, write_shadow_run

SIZE_PX = (280, 80)
NOZZLE = "view2=0:90,0:80"


@pytest.fixture
def measured(tmp_path: Path) -> tuple[ShadowScene, list[object]]:
    """A run with a nozzle before the left third of view2, and the command that measures it."""
    shot = shadow_scene((100, 24, 160), 10, SIZE_PX)
    image = shot.images[1].copy()
    image[:, :86] = 0.02
    seen = replace(shot, images=[shot.images[0], image, *shot.images[2:]])
    run_dir = write_shadow_run(tmp_path / "run", seen)
    calibration = write_shadow_calibration(tmp_path / "calibration.json", shot)
    ends = np.array(shot.grid.shape) - 1
    low_mm, high_mm = (shot.grid.to_mm(np.array([index])).ravel() for index in (np.zeros(3), ends))
    box = ",".join(f"{low}:{high}" for low, high in zip(low_mm, high_mm, strict=True))
    return shot, ["measure", run_dir, "--calibration", calibration, f"--grid={box}"]


def test_a_nozzle_that_is_ignored_leaves_the_droplets_to_the_other_views(
    measured: tuple[ShadowScene, list[object]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shot, arguments = measured
    assert main([*map(str, arguments), "-o", str(tmp_path / "asked"), "--json"]) == 1
    capsys.readouterr()
    (told_shot,) = told(capsys, *arguments, "-o", tmp_path / "out", "--ignore", NOZZLE)["shots"]
    assert told_shot["verdict"] == "good"
    stored = read_droplets(tmp_path / "out" / told_shot["file"])
    points_mm = np.column_stack([stored.columns[f"{axis}_mm"] for axis in "xyz"])
    of_found, of_truth = matches(points_mm, shot.points_mm, shot.grid.pitch_mm)
    assert np.mean(of_truth[shot.diameters_mm > 0.03] >= 0) > 0.9
    assert np.mean(of_found < 0) <= 0.03
    assert "'ignored'" in str(stored.provenance["settings"]).replace('"', "'")


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("view2", "write VIEW=LEFT:RIGHT,TOP:BOTTOM"),
        ("view2=0:10", "write VIEW=LEFT:RIGHT,TOP:BOTTOM"),
        ("view9=0:10,0:10", "there is no view view9; views are view1, view2"),
        ("view2=10:10,0:10", "must lie in the image, 280 x 80 px"),
        ("view2=0:10,0:81", "must lie in the image, 280 x 80 px"),
    ],
)
def test_rectangles_that_are_in_no_image_are_named(text: str, problem: str) -> None:
    with pytest.raises(PipelineError, match=problem):
        require_fitting([text], dict.fromkeys(("view1", "view2"), SIZE_PX))


@pytest.mark.parametrize("ignored", [("v=1:3,0:2",), ("v=2:3,0:2", "v=1:2,0:2")])
def test_what_is_not_asked_is_not_known_and_nothing_else_changes(ignored: Sequence[str]) -> None:
    trust = np.ones((4, 5), np.float32)
    known = without_ignored({"v": trust}, ignored)["v"]
    assert trust.all()
    assert np.argwhere(known == 0).tolist() == [[0, 1], [0, 2], [1, 1], [1, 2]]


@pytest.mark.parametrize("option", [("--ignore", "view1=0:9,0:9"), ("--light", "0.8"), ("--light", "incoherent")])
def test_options_of_shadows_are_refused_for_bright_particles(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], option: Sequence[str]
) -> None:
    run_dir = write_bright_run(tmp_path / "run")
    write_bright_calibration(tmp_path / "calibration.json")
    arguments = ["measure", run_dir, "--calibration", tmp_path / "calibration.json", "-o", tmp_path / "out"]
    assert "for shadows" in refused(capsys, *arguments, f"--grid={BOX}", *option)
    assert not (tmp_path / "out").exists()
