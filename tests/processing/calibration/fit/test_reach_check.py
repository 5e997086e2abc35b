"""A view that is known in a part of the volume only is not called good for all of it."""

import numpy as np
import pytest

from processing.calibration.calibrate import calibrate
from processing.calibration.observation import PlaneObservation
from processing.calibration.verdict import Verdict
from processing.geometry import PinholeCamera
from tests.support.calibration_cases import calibration_set, paper_camera, seen_planes

FEW_MM = (-4.5, 0.0, 4.5)
BOX_MM = np.random.default_rng(1).uniform([-8, -6, -4.5], [8, 6, 4.5], (500, 3))


def camera(azimuth_deg: float) -> PinholeCamera:
    return paper_camera(azimuth_deg, (0.0, 0.0), (0.0,) * 5)


def cropped(planes: tuple[PlaneObservation, ...], share: float) -> tuple[PlaneObservation, ...]:
    """Points in one corner of the image alone."""
    corner_px = share * np.array([1600, 1200])
    return tuple(plane.select(np.all(plane.image_px < corner_px, axis=1)) for plane in planes)


@pytest.mark.parametrize(("share", "expected"), [(0.35, Verdict.WARN), (1.0, Verdict.GOOD)])
def test_a_view_whose_points_fill_a_corner_of_its_image_is_not_good(share: float, expected: Verdict) -> None:
    planes = {f"at{angle}": seen_planes(camera(angle), FEW_MM, 0.03, seed=angle + 90) for angle in (45, 15, -15)}
    calibration = calibrate(calibration_set(**{**planes, "at45": cropped(planes["at45"], share)}))
    assert {name: view.verdict for name, view in calibration.views.items()} == {
        "at45": expected,
        "at15": Verdict.GOOD,
        "at-15": Verdict.GOOD,
    }
    off_px = np.linalg.norm(calibration.views["at45"].mapping.project(BOX_MM) - camera(45).project(BOX_MM), axis=1)
    assert (off_px.max() > 0.3) == (expected is Verdict.WARN)
    assert ("one standard deviation" in " ".join(calibration.notes)) == (expected is Verdict.WARN)
