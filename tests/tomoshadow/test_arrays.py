"""Arrays that are not what they seem: no function takes them for what they would be without that."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tomoshadow as ts
from tests.tomoshadow.test_reconstruction import CAMERAS, DROPLET_MM, GRID, calibration, images

MASKED: Any = np.ma.masked_greater(np.random.default_rng(1).uniform(1, 99, (64, 64, 64)).astype(np.float32), 90)
PLAIN: Any = MASKED.data
FINE = ts.VoxelGrid.centred((18, 45, 60), 0.0667)
"""About a voxel per pixel."""
BOARD = ts.Checkerboard(columns=11, rows=7, pitch_mm=2.0)


def spoilt() -> dict[str, Any]:
    return {name: np.ma.masked_greater(image, 0.5) for name, image in images().items()}


TAKEN: dict[str, Callable[[Path], object]] = {
    "background": lambda _: ts.intensity(np.full((64, 64), 99, np.uint8), bits=8, background=MASKED[0]),
    "images of mlos": lambda _: ts.mlos(ts.plan(calibration(), GRID), spoilt()),
    "images of smart": lambda _: ts.smart(ts.plan(calibration(), GRID), spoilt(), iterations=1),
    "images of measure": lambda _: ts.measure(calibration(), spoilt(), GRID),
    "image of measure_flat": lambda _: ts.measure_flat(MASKED[0]),
    "mean_diameters": lambda _: ts.mean_diameters([MASKED[0, 0]]),
    "size_classes": lambda _: ts.size_classes(MASKED[0, 0]),
    "quality_factor": lambda _: ts.quality_factor(PLAIN, MASKED),
    "volume": lambda folder: ts.write_volume(folder / "a.vtkhdf", MASKED, ts.VoxelGrid.centred((64, 64, 64), 0.1)),
    "find_target": lambda _: ts.find_target({"view1": {0.0: MASKED[0]}}, BOARD),
}


@pytest.mark.parametrize("taken", TAKEN)
def test_masked_values_do_not_count_as_they_are(tmp_path: Path, taken: str) -> None:
    with pytest.raises(ValueError, match="has masked values"):
        TAKEN[taken](tmp_path)


def test_masks_have_no_droplets() -> None:
    masks: Any = {name: image > 0.5 for name, image in images().items()}
    with pytest.raises(ValueError, match="view1: is of bool, which has no grey values"):
        ts.measure(calibration(), masks, FINE, polarity="shadow")


def test_a_droplet_before_nothing_at_all_is_measured() -> None:
    """Its view has no noise and hardly a bright pixel: there is nothing to divide by."""
    counts: Any = {name: np.floor(200 * image) for name, image in images().items()}
    found = ts.measure(calibration(), counts, FINE)
    np.testing.assert_allclose(found.droplets.points_mm, DROPLET_MM, atol=0.02)


@pytest.mark.parametrize("method", ["mlos", "smart"])
def test_grey_values_are_no_intensities(method: str) -> None:
    """Shadows as they are recorded are bright where nothing is: a volume of what is free."""
    frames: Any = {name: np.full(camera.image_size_px[::-1], 200, np.uint8) for name, camera in CAMERAS.items()}
    with pytest.raises(ValueError, match="view1: its image is of uint8; make grey values intensities first"):
        getattr(ts, method)(ts.plan(calibration(), GRID), frames)


SHADOW = np.where(np.hypot(*np.mgrid[-40:40, -50:50]) < 10, 50.0, 200.0)


@pytest.mark.parametrize(
    ("image", "background", "problem"),
    [
        (SHADOW > 100, None, "image: is of bool, which has no grey values"),
        (SHADOW * 1j, None, "image: is of complex128"),
        (np.dstack([SHADOW] * 3), None, r"image: .* is \(rows, columns\), not \(80, 100, 3\)"),
        (SHADOW, np.where(SHADOW < 100, np.nan, SHADOW), r"background: pixel \(column 4\d, row 3\d\) is nan"),
        (SHADOW, SHADOW[:1] + 9, r"background image \(1, 100\) does not fit the image \(80, 100\)"),
    ],
)
def test_what_is_no_image_of_grey_values_has_no_droplets(image: Any, background: Any, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        ts.measure_flat(image, background=background)


def test_a_background_that_is_turned_hides_no_droplet() -> None:
    light = 1 + 0.006 * np.arange(-50, 50)
    assert len(ts.measure_flat(SHADOW * light, background=200 * np.ones((80, 1)) * light)) == 1
    with pytest.raises(ts.BadInput, match="but the same one with left and right exchanged"):
        ts.measure_flat(SHADOW * light, background=200 * np.ones((80, 1)) * light[::-1])


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_voxel_that_is_no_number_does_not_take_its_window_out_of_the_mean(value: float) -> None:
    volume = np.concatenate([PLAIN, PLAIN])
    volume[100, 3, 3] = value
    with pytest.raises(ValueError, match="infinite or not a number"):
        ts.quality_factor(np.concatenate([PLAIN, PLAIN]), volume)


@pytest.mark.parametrize(
    ("stated", "problem"),
    [
        ({"roll_deg": {"vieww": 180.0}}, "vieww: something is stated of it, and images are of view1"),
        ({"origin_px": {"vieww": (3.0, 4.0)}}, "vieww"),
        ({"azimuth_deg": {"view1": np.nan}}, "view1: nan is stated of it, which is not finite"),
    ],
)
def test_what_is_stated_of_no_view_is_not_passed_over(stated: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        ts.find_target({"view1": {0.0: PLAIN[0]}}, BOARD, **stated)
