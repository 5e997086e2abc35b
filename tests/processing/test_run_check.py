"""What a shot says of the views: which one has moved, or that it is not one alone."""

import numpy as np
import pytest

from processing.calibration.disparity import measured_box, shot_disparity
from processing.geometry import FloatArray
from processing.run_check import ShotCheck
from tests.processing.drifting_views import calibration_of, inside_mm, views

CALIBRATION = calibration_of(views())
MAPPINGS = [view.mapping for view in CALIBRATION.views.values()]


def checked(drifts_px: dict[int, tuple[float, float]]) -> ShotCheck:
    """A shot of droplets that are seen to a twentieth of a pixel; some views have moved."""
    rng = np.random.default_rng(5)
    seen: list[FloatArray] = []
    for view, mapping in enumerate(MAPPINGS):
        image_px = mapping.project(inside_mm(120)) + drifts_px.get(view, (0.0, 0.0))
        seen.append(image_px + rng.normal(0, 0.05, image_px.shape))
    measured = shot_disparity(MAPPINGS, [seen], measured_box(CALIBRATION))
    return ShotCheck(0, dict(zip(CALIBRATION.views, measured, strict=True)))


@pytest.mark.parametrize("drift_px", [(0.45, 0.0), (0.0, -0.45), (1.5, 1.0)])
@pytest.mark.parametrize("view", range(4))
def test_the_view_that_moved_is_named_and_its_disparity_is_its_drift(view: int, drift_px: tuple[float, float]) -> None:
    check = checked({view: drift_px})
    assert check.moved == f"view{view + 1}"
    assert check.views[check.moved].disparity_px == pytest.approx(np.hypot(*drift_px), abs=0.06)
    assert check.views[check.moved].left_px < 0.03


def test_two_that_moved_are_not_blamed_on_one() -> None:
    check = checked({0: (0.0, 0.7), 2: (0.8, -0.6)})
    assert check.worst_px > 0.5
    assert check.moved is None


def test_small_disparities_are_blamed_on_nobody() -> None:
    check = checked({1: (0.2, 0.0)})
    assert check.worst_px == pytest.approx(0.2, abs=0.05)
    assert check.moved is None
