"""What a calibration cannot know is said with it."""

from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from processing.calibration.calibrate import calibrate
from processing.calibration.calibration import Calibration
from processing.calibration.observation import CalibrationSet, PlaneObservation, ViewObservations
from processing.calibration.verdict import Verdict
from processing.geometry import view_camera

AZIMUTHS_DEG = {"view1": 45.0, "view2": -45.0}
SIZE_PX = (1200, 1000)


def calibrated(
    z_mm: Sequence[float],
    claimed_mm: Sequence[float],
    azimuths_deg: Mapping[str, float] | None = None,
    model: str = "pinhole",
    flipped: str = "",
) -> Calibration:
    """Of planes that stand somewhere, and are said to stand somewhere else."""
    x_mm, y_mm = np.meshgrid(np.linspace(-8, 8, 9), np.linspace(-6, 6, 7))
    rng, views = np.random.default_rng(1), {}
    for name, azimuth_deg in AZIMUTHS_DEG.items():
        camera = view_camera(
            azimuth_deg, focal_length_mm=85, magnification=0.43, scale_px_per_mm=60, image_size_px=SIZE_PX
        )
        planes = []
        for true_mm, said_mm in zip(z_mm, claimed_mm, strict=True):
            true, said = (np.column_stack([x_mm.ravel(), y_mm.ravel(), np.full(63, z)]) for z in (true_mm, said_mm))
            seen_px = camera.project(true) + rng.normal(0, 0.03, (63, 2))
            for axis in ("xy".index(name) for name in flipped):  # whoever finds corners labels them as he sees them
                seen_px[:, axis], said[:, axis] = SIZE_PX[axis] - 1 - seen_px[:, axis], -said[:, axis]
            planes.append(PlaneObservation(f"z {said_mm}", said, seen_px, said_mm))
        views[name] = ViewObservations(SIZE_PX, tuple(planes))
    return calibrate(CalibrationSet("set", None, views, azimuths_deg=azimuths_deg or {}), model)


def test_two_planes_at_a_wrong_distance_fit_and_that_is_said() -> None:
    calibration = calibrated((-4, 4), (-4, 5))
    assert {view.verdict for view in calibration.views.values()} <= {Verdict.GOOD, Verdict.USABLE}
    told = [one.state for one in calibration.not_checked if "two planes are as far apart as z_mm says" in one.what]
    assert told == ["a third plane, or azimuth_deg of view1, view2"]


@pytest.mark.parametrize(
    ("z_mm", "claimed_mm", "azimuths_deg"), [((-4, 0, 4), (-4, 0, 5), {}), ((-4, 4), (-4, 5), AZIMUTHS_DEG)]
)
def test_a_third_plane_or_the_azimuths_tell(
    z_mm: tuple[float, ...], claimed_mm: tuple[float, ...], azimuths_deg: Mapping[str, float]
) -> None:
    calibration = calibrated(z_mm, claimed_mm, azimuths_deg)
    assert {view.verdict for view in calibration.views.values()} <= {Verdict.WARN, Verdict.REFUSE}
    assert not [one for one in calibration.not_checked if "two planes" in one.what]


@pytest.mark.parametrize("azimuths_deg", [{}, {"view1": 45.0}, AZIMUTHS_DEG], ids=["none", "one", "both"])
def test_steps_of_the_stage_that_are_all_too_short_are_told_or_said_to_be_unknown(
    azimuths_deg: Mapping[str, float],
) -> None:
    calibration = calibrated((-4, -2, 0, 2, 4), (-3.88, -1.94, 0, 1.94, 3.88), azimuths_deg)
    told = any("if z were 1.03" in note for note in calibration.notes)
    said = any("in proportion" in one.what for one in calibration.not_checked)
    assert (told, said) == ((True, False) if len(azimuths_deg) == 2 else (False, True))


@pytest.mark.parametrize(("model", "says"), [("pinhole", False), ("polynomial", True)])
def test_a_polynomial_says_that_it_fits_any_pitch_and_step(model: str, says: bool) -> None:
    calibration = calibrated((-4, -2, 0, 2, 4), (-4.2, -2.1, 0, 2.1, 4.2), model=model)
    assert any("step or travel of the stage" in one.what for one in calibration.not_checked) == says


def test_views_that_are_all_upside_down_agree_and_that_is_said() -> None:
    """y points up then, in a world in which all else is as it should be: no azimuth and no droplet tells."""
    for flipped in ("", "y"):
        calibration = calibrated((-4, -2, 0, 2, 4), (-4, -2, 0, 2, 4), AZIMUTHS_DEG, flipped=flipped)
        assert {view.verdict for view in calibration.views.values()} == {Verdict.GOOD}
        (told,) = [one for one in calibration.not_checked if "all views are upside down alike" in one.what]
        assert "nozzle and direction" in told.state


@pytest.mark.parametrize("flipped", ["x", "xy"])
def test_views_that_are_all_mirrored_or_turned_stand_elsewhere(flipped: str) -> None:
    calibration = calibrated((-4, -2, 0, 2, 4), (-4, -2, 0, 2, 4), AZIMUTHS_DEG, flipped=flipped)
    assert any(view.verdict in (Verdict.WARN, Verdict.REFUSE) for view in calibration.views.values())
    assert any("azimuth" in reason for view in calibration.views.values() for reason in view.reasons)
