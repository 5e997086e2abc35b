"""``tomoshadow size-calibration`` and ``measure --sizes``: from the run of a reticle to corrected diameters."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import read_droplets
from processing.analysis.droplets.ghost_share import matches
from server.cli.main import main
from tests.support.command_line import refused, told
from tests.support.reticle_scenes import reticle_scene
from tests.support.shadow_scenes import shadow_scene, write_shadow_calibration, write_shadow_run

DIAMETERS_UM = (40.0, 110.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a reticle in coherent light, its calibration, and its sizes as they look behind a Gaussian blur."""
    folder = tmp_path_factory.mktemp("reticle")
    scene = reticle_scene(0.8, diameters_um=DIAMETERS_UM, columns=4)
    write_shadow_run(folder / "run", scene)
    write_shadow_calibration(folder / "calibration.json", scene)
    return folder


@pytest.fixture(scope="module")
def sizes(folder: Path) -> Path:
    out = folder / "sizes.json"
    assert main([str(part) for part in command(folder, out, "--light", "gaussian")]) == 0
    return out


def command(folder: Path, out: Path, *more: object, diameters: str = "40,110") -> list[object]:
    return [
        "size-calibration",
        folder / "run",
        "--calibration",
        folder / "calibration.json",
        "--diameters",
        diameters,
        "-o",
        out,
        *more,
    ]


def test_the_file_says_what_is_found_in_which_light(sizes: Path) -> None:
    found = json.loads(sizes.read_text())
    assert found["schema"] == "tomoshadow/sizes"
    assert found["light"] == "gaussian"
    assert [size["true_um"] for size in found["sizes"]] == list(DIAMETERS_UM)
    assert all(size["found_um"] - size["true_um"] > 6 for size in found["sizes"])
    assert all(set(size["views_um"]) == {"view1", "view2", "view3", "view4"} for size in found["sizes"])


def test_droplets_are_corrected_by_it(sizes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A spray in light that makes droplets look smaller, and a reticle that says by how much."""
    scene = shadow_scene((60, 24, 100), 14, (200, 66), blurs_px=(0.7,) * 4, sharp=True)
    said = json.loads(sizes.read_text())
    for size, found in zip(said["sizes"], (38.5, 106.5), strict=True):
        size |= {"found_um": found, "sd_um": 0.0}
    (reticle := tmp_path / "reticle.json").write_text(json.dumps(said))
    write_shadow_run(tmp_path / "run", scene)
    calibration, out = write_shadow_calibration(tmp_path / "calibration.json", scene), tmp_path / "out"
    low_mm, high_mm = (scene.grid.to_mm(np.array([index]))[0] for index in (np.zeros(3), np.array([59, 23, 99])))
    box = ",".join(f"{low}:{high}" for low, high in zip(low_mm, high_mm, strict=True))
    measure = [
        "measure",
        tmp_path / "run",
        "--calibration",
        calibration,
        "-o",
        out,
        f"--grid={box}",
        "--sizes",
        reticle,
    ]
    told(capsys, *measure)
    columns = read_droplets(out / "shot_00000_droplets.h5").columns
    points_mm = np.column_stack([columns[f"{axis}_mm"] for axis in "xyz"])
    match, _ = matches(points_mm, scene.points_mm, scene.grid.pitch_mm)
    true_um = 1000 * scene.diameters_mm[match[match >= 0]]
    raw_um, found_um, sd_um = (
        columns[name][match >= 0].astype(float) for name in ("diameter_raw_um", "diameter_um", "diameter_sd_um")
    )
    assert len(true_um) > 5
    assert np.median(raw_um - true_um) < -1.5
    assert abs(np.median(found_um - true_um)) < 0.7
    assert np.all(sd_um >= 1)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("40,110,200", "3 diameters are stated, and dots of 2 sizes are seen"),
        ("20,55", "look as if they had"),
    ],
)
def test_another_reticle_is_refused(
    folder: Path, text: str, complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "sizes.json"
    assert complaint in refused(capsys, *command(folder, out, "--light", "gaussian", diameters=text))
    assert not out.exists()


@pytest.mark.parametrize(
    ("text", "complaint"), [("40,30", "from the smallest"), ("40,x", "no number"), ("0,40", "above 0")]
)
def test_diameters_are_stated_from_the_smallest_on(
    text: str, complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        main([str(part) for part in command(tmp_path, tmp_path / "sizes.json", diameters=text)])
    assert complaint in capsys.readouterr().err


def test_sizes_are_those_of_one_light(
    folder: Path, sizes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    measure = ("measure", folder / "run", "--calibration", folder / "calibration.json", "-o", tmp_path / "out")
    assert "measured in light gaussian" in refused(capsys, *measure, "--sizes", sizes, "--light", "0.8")
    other = tmp_path / "other.json"
    other.write_text(sizes.read_text().replace('"true_um"', '"truth_um"'))
    assert "other.json: no size calibration: sizes.0.true_um" in refused(capsys, *measure, "--sizes", other)
    assert "nowhere.json" in refused(capsys, *measure, "--sizes", tmp_path / "nowhere.json")


def test_sizes_are_for_droplets_in_space(
    folder: Path, sizes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    measure = ("measure", folder / "run", "--view", "view2", "-o", tmp_path / "out", "--sizes", sizes)
    assert refused(capsys, *measure) == "--sizes: needs --calibration"


def test_sizes_by_another_calibration_are_told(
    folder: Path, sizes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Self-calibration makes another one of the same views, so they are no reason to refuse."""
    other = tmp_path / "other.json"
    other.write_text(sizes.read_text().replace('"calibration": "cal-', '"calibration": "cal-of-another-'))
    measure = ["measure", folder / "run", "--calibration", folder / "calibration.json", "-o", tmp_path / "out"]
    told_of = {}
    for file in (sizes, other):
        assert main([*map(str, measure), "--shots", "7:8", "--sizes", str(file)]) == 2
        told_of[file] = capsys.readouterr().err
    assert "its reticle was measured by cal-of-another-" in told_of[other]
    assert "its reticle" not in told_of[sizes]


def test_a_reticle_that_moved_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In the mean of both shots its dots are 5 um too small, and little light is left around them."""
    scene = reticle_scene(0.8, diameters_um=DIAMETERS_UM, columns=4)
    moved = replace(scene, images=[np.roll(image, 2, axis=1) for image in scene.images])
    write_shadow_run(tmp_path / "run", scene, moved)
    write_shadow_calibration(tmp_path / "calibration.json", scene)
    out = tmp_path / "sizes.json"
    complaint = refused(capsys, *command(tmp_path, out, "--light", 0.8))
    assert complaint.startswith("run, shot 1, view1: its image lies about 1.")
    assert "--shots" in complaint
    assert not out.exists()
