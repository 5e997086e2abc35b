"""Lengths that are wrong by a few percent fit as well as the right ones; shapes of pixels and azimuths tell them."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from processing.calibration.calibrate import calibrate
from processing.calibration.calibration import Calibration
from tests.support.calibration_cases import calibration_set, paper_camera, seen_planes

AZIMUTHS_DEG = {"view1": 45.0, "view2": 15.0, "view3": -15.0, "view4": -45.0}
Z_MM = (-4, 0, 4)


def calibrated(
    said_of_true: tuple[float, float, float] = (1, 1, 1),
    askew: float = 0.0,
    sheared: Any = 0.0,
    beside_deg: tuple[float, ...] = (0, 0, 0, 0),
    tilts_deg: tuple[float, ...] = (0, 0, 0, 0),
    model: str = "pinhole",
) -> Calibration:
    """Views of true cameras, whose points are said to be elsewhere, and that stand beside what the rig says."""
    views = {}
    for (name, azimuth_deg), tilt_deg in zip(AZIMUTHS_DEG.items(), tilts_deg, strict=True):
        camera = replace(paper_camera(azimuth_deg, (0, 0), (0, 0, 0, 0, 0)), tilt_rad=(0.0, np.deg2rad(tilt_deg)))
        planes = seen_planes(camera, Z_MM, seed=int(azimuth_deg) + 50, columns=11, rows=9)
        said = np.diag(said_of_true) - askew * np.eye(3)[[2]].T * np.eye(3)[0] - sheared
        views[name] = tuple(replace(plane, points_mm=plane.points_mm @ said) for plane in planes)
    said_deg = {name: angle + off for (name, angle), off in zip(AZIMUTHS_DEG.items(), beside_deg, strict=True)}
    return calibrate(replace(calibration_set(**views), azimuths_deg=said_deg), model)


@pytest.mark.parametrize(("longer", "said_of_true"), [(0.95, (1, 1, 1 / 0.95)), (1.03, (1.03, 1.03, 1))])
def test_a_length_that_is_a_few_percent_wrong_is_told(longer: float, said_of_true: tuple[float, float, float]) -> None:
    calibration = calibrated(said_of_true)
    (note,) = calibration.notes
    told = re.fullmatch(r"if z were ([\d.]+) times as long, all pixels .* or is it pitch_mm ([\d.]+)\?", note)
    assert told
    assert float(told[1]) == pytest.approx(longer, abs=0.004)
    assert float(told[2]) == pytest.approx(1 / longer, abs=0.006)
    assert {view.verdict for view in calibration.views.values()} == {"warn"}


def test_right_lengths_are_not_doubted_because_the_rig_knows_its_azimuths_badly() -> None:
    assert calibrated(beside_deg=(0.7, -0.5, 0.6, -0.7)).notes == ()


def test_tilted_sensors_are_no_wrong_length() -> None:
    """By Scheimpflug's rule, at a magnification of 0.45; a model without tilt sees pixels that are not square."""
    tilts_deg = tuple(np.rad2deg(np.arctan(0.45 * np.tan(np.deg2rad(angle)))) for angle in AZIMUTHS_DEG.values())
    notes = calibrated(tilts_deg=tilts_deg).notes
    assert not any(said in note for note in notes for said in ("were", "askew", "slanted"))


def test_a_target_that_is_wider_than_was_said_is_told() -> None:
    """A print that a driver has fitted to the page; points alone cannot tell, nor can lines of sight."""
    notes = " ".join(calibrated((1 / 1.01, 1, 1)).notes)
    told = re.fullmatch(r"if x were ([\d.]+) times as long, all pixels would be square: .*its print scaled\?", notes)
    assert float(told[1] if told else 0) == pytest.approx(1.01, abs=0.004)


def test_a_stage_that_moves_askew_is_told() -> None:
    calibration = calibrated(askew=float(np.tan(np.deg2rad(-4.0))))
    told = re.search(r"if the stage moved (-?[\d.]+) deg askew towards x", " ".join(calibration.notes))
    assert float(told[1] if told else 0) == pytest.approx(-4.0, abs=0.2)
    assert {view.verdict for view in calibration.views.values()} == {"warn"}


@pytest.mark.parametrize("model", ["pinhole", "pinhole_tilted"])
def test_a_stage_that_moves_askew_towards_y_is_told(model: str) -> None:
    """The lens's axis moves far beside the image, and the fit is as good as any."""
    sheared = np.tan(np.deg2rad(-2.0)) * np.outer(np.eye(3)[2], np.eye(3)[1])
    told = re.fullmatch(
        r"if the stage moved (-?[\d.]+) deg askew towards y.*", " ".join(calibrated(sheared=sheared, model=model).notes)
    )
    assert float(told[1] if told else 0) == pytest.approx(-2.0, abs=0.2)


def test_a_target_that_is_not_as_high_as_was_said_is_told() -> None:
    told = re.fullmatch(r"if y were ([\d.]+) times as long.*", " ".join(calibrated((1, 1.02, 1)).notes))
    assert float(told[1] if told else 0) == pytest.approx(1 / 1.02, abs=0.002)


def test_a_target_whose_columns_slant_is_told() -> None:
    """A print of a scanner or a camera; no stage, and no lens, looks like it."""
    notes = " ".join(calibrated(sheared=-np.tan(np.deg2rad(1.5)) * np.outer(np.eye(3)[1], np.eye(3)[0])).notes)
    told = re.fullmatch(r"if columns of the target slanted by (-?[\d.]+) deg.*", notes)
    assert abs(float(told[1] if told else 0)) == pytest.approx(1.5, abs=0.2)
