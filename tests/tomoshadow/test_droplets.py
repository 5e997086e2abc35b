"""``tomoshadow.measure``: droplets of images by the names of their views."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tomoshadow as ts
from processing.calibration.verdict import Doubt
from processing.studies.velocity.double_scenes import SEPARATION_NS
from tests.support.bright_scenes import GRID, MARGIN_VOXEL, moving_scene, scene, write_bright_calibration


def test_droplets_of_named_images_are_measured_in_any_order(tmp_path: Path) -> None:
    calibration, truth = ts.load_calibration(write_bright_calibration(tmp_path / "calibration.json")), scene()
    images = dict(zip(calibration.views, truth.images, strict=True))
    first, second = (
        ts.measure(calibration, {name: images[name] for name in names}, GRID, margin_voxel=MARGIN_VOXEL)
        for names in (list(images), list(images)[::-1])
    )
    assert first.verdict == "good"
    assert list(second.views) == list(images)[::-1]
    assert len(first.droplets) == pytest.approx(len(truth.heights), abs=2)
    assert len(second.droplets) == pytest.approx(len(first.droplets), abs=1)
    assert {len(column) for column in first.droplets.columns().values()} == {len(first.droplets)}


def test_what_a_calibration_says_against_itself_makes_droplets_doubtful(tmp_path: Path) -> None:
    calibration, truth = ts.load_calibration(write_bright_calibration(tmp_path / "calibration.json")), scene()
    doubted = calibration.doubted([Doubt(tuple(calibration.views), "is pitch_mm right?")])
    images = dict(zip(calibration.views, truth.images, strict=True))
    found = ts.measure(doubted, images, GRID, margin_voxel=MARGIN_VOXEL)
    assert (found.verdict, [reason.endswith("is pitch_mm right?") for reason in found.reasons]) == ("doubtful", [True])


def test_two_exposures_give_velocities(tmp_path: Path) -> None:
    calibration, truth = ts.load_calibration(write_bright_calibration(tmp_path / "calibration.json")), moving_scene()
    first, second = (
        ts.measure(calibration, dict(zip(calibration.views, images, strict=True)), GRID) for images in truth.images
    )
    found = ts.measure_velocities(first, second, GRID, separation_ns=SEPARATION_NS)
    assert found.verdict == "good"
    assert len(found.first.velocities_m_s) == len(first.droplets)
    assert found.mean_m_s == pytest.approx(truth.before.velocities_mm_per_s.mean(axis=0) / 1000, rel=0.1)
    assert found.share_paired is not None
    assert found.share_paired > 0.97


def test_what_cannot_be_measured_is_named(tmp_path: Path) -> None:
    calibration = ts.load_calibration(write_bright_calibration(tmp_path / "calibration.json"))
    with pytest.raises(ts.BadInput, match=r"views \['view9'\] are not in calibration"):
        ts.measure(calibration, {"view9": np.zeros((100, 240), np.float32)}, GRID)


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"light": 0.8}, "light 0.8 is for shadows"),
        ({"light": "incoherent"}, "light 'incoherent' is for shadows"),
        ({"polarity": "shadow", "light": 12.0}, "light 12.0: estimated, incoherent, .* or a number above 0 up to 8"),
        ({"polarity": "shadow", "light": "coherent"}, "light 'coherent': estimated"),
        ({"polarity": "shadows"}, "polarity 'shadows': shadow or bright"),
    ],
)
def test_options_that_mean_nothing_are_refused(tmp_path: Path, options: dict[str, Any], problem: str) -> None:
    calibration = ts.load_calibration(write_bright_calibration(tmp_path / "calibration.json"))
    dark = dict.fromkeys(calibration.views, np.zeros((100, 240), np.float32))
    with pytest.raises(ValueError, match=problem):
        ts.measure(calibration, dark, GRID, margin_voxel=MARGIN_VOXEL, **options)
