"""Inputs on which programs like this one go wrong: each gives the right value, or a sentence on what is wrong."""

import os
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from processing.reconstruction.volume_file import read_volume
from tests.support.command_line import told

DATA = os.environ.get("TOMOSHADOW_DATA")
pytestmark = pytest.mark.skipif(not DATA, reason="TOMOSHADOW_DATA is not set: no images from elsewhere")

REFUSED = {
    "02_planes_of_one_view_reversed": ("calibrate", "cam2: left-handed.* unlike cam0, cam1"),
    "03_12_bit_in_16_bit_bright_is_black": ("import", "the brightest pixel .* is 3040.*state the bits"),
    "05_two_level_plate_crashes": ("calibrate", "a plate with dots on two levels is not supported"),
    "06_multipage_tiff_first_page_only": ("import", "cam0.tif: holds 3 images; say by page = 0 to 2"),
    "08_seeds_in_one_plane": ("calibrate", "the seeds lie in one plane"),
    "11_v_counted_from_the_bottom": ("calibrate", 'v count from the bottom .v_axis = "up".*u and v, or x and y'),
    "12_tables_are_read_too_late": ("import", "cam0.txt, line 1: .*header.*cam1.txt, line 1: .*decimal.*cam2.txt: no"),
}
GOOD = {
    "07_ring_round_the_origin_not_seen": {"cam0": 351, "cam1": 351, "cam2": 351},
    "13_tiff_orientation_is_obeyed_jpeg_is_not": {"cam0": 351},
    "16_large_and_blurred_board_not_found": {"cam0": 351},
    "17_blurred_corner_of_a_free_board_crashes": {"cam0": 60},
}


def given(name: str, folder: Path) -> Path:
    """A copy of the input; its manifest."""
    shutil.copytree(Path(str(DATA), "faults", name), folder, copy_function=shutil.copyfile)
    folder.chmod(0o755)
    return folder / "manifest.toml"


def calibrated(manifest: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    out = manifest.parent
    told(capsys, "import", manifest, "-o", out / "set")
    answer: dict[str, Any] = told(capsys, "calibrate", out / "set", "-o", out / "calibration.json")
    return answer


def found(folder: Path, capsys: pytest.CaptureFixture[str]) -> int:
    """Particles of the true list that the volume of the default box shows."""
    arguments = ["--calibration", folder / "calibration.json", "--method", "mlos", "-o", folder / "volumes"]
    told(capsys, "reconstruct", folder / "set" / "run", *arguments)
    volume, grid, _ = read_volume(folder / "volumes" / "shot_00000_a.vtkhdf")
    index = np.rint(grid.to_index(np.loadtxt(folder / "particles_mm.txt"))).astype(int)
    inside = ((index >= 2) & (index < np.array(volume.shape) - 2)).all(axis=1)
    return sum(
        volume[z - 2 : z + 3, y - 2 : y + 3, x - 2 : x + 3].max() > 0.3 * volume.max() for z, y, x in index[inside]
    )


def test_every_known_fault_is_tried() -> None:
    there = {path.name for path in Path(str(DATA), "faults").iterdir() if path.is_dir()}
    assert there == REFUSED.keys() | GOOD.keys() | {"09_default_box_is_a_sliver", "15_warn_without_a_reason"}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_right_is_refused_in_a_sentence(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command, sentence = REFUSED[name]
    manifest = given(name, tmp_path / "given")
    imported = told(capsys, "import", manifest, "-o", tmp_path / "set", status=2 if command == "import" else 0)
    if command == "calibrate":
        imported = told(capsys, "calibrate", tmp_path / "set", "-o", tmp_path / "calibration.json", status=2)
    assert re.search(sentence, imported["error"]), imported["error"]


@pytest.mark.parametrize("name", GOOD)
def test_what_others_miss_is_found(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    views = calibrated(given(name, tmp_path / "given"), capsys)["views"]
    assert {view: figures["n_points"] for view, figures in views.items()} == GOOD[name]
    assert all(figures["verdict"] == "good" for figures in views.values())


def test_grey_values_are_those_of_the_stated_bits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    manifest = given("03_12_bit_in_16_bit_bright_is_black", tmp_path / "given")
    text = manifest.read_text(encoding="utf-8").replace("[run]", "[run]\nbits = 12", 1)
    manifest.unlink()
    manifest.write_text(text, encoding="utf-8")
    calibrated(manifest, capsys)
    assert found(manifest.parent, capsys) == 40


def test_the_default_box_is_the_largest_whatever_the_views(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Views at 90, -90, 0 and 180 deg: none sees the whole depth together with the others."""
    manifest = given("09_default_box_is_a_sliver", tmp_path / "given")
    views = calibrated(manifest, capsys)["views"]
    assert all(figures["verdict"] == "good" for figures in views.values())
    assert found(manifest.parent, capsys) >= 180


def test_a_warning_has_its_reason(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    views = calibrated(given("15_warn_without_a_reason", tmp_path / "given"), capsys)["views"]
    for figures in views.values():
        assert (figures["verdict"], figures["n_rejected"]) == ("warn", 20)
        assert "20 points that were left out lie on one spot (-1, -1)" in "; ".join(figures["reasons"])
