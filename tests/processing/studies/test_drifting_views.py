"""Views drift in directions of their own, and the watch is judged by every shot."""

import numpy as np
import pytest

from processing.calibration.droplets.disparity import ViewDisparity
from processing.studies.drifting_views import _watched_row, direction


@pytest.mark.parametrize(
    ("drift_px", "disparities_px", "kept"),
    [
        (0.0, [0.05, 0.02, 0.12], True),
        (0.0, [0.01] * 11 + [0.31], False),
        (0.0, [0.11, 0.12, 0.1], False),
        (0.4, [0.42, 0.38, 0.31], True),
        (0.4, [0.4] * 11 + [0.304], False),
        (0.4, [0.4, 0.4, np.inf], False),
    ],
)
def test_the_watch_is_judged_by_all_its_shots(drift_px: float, disparities_px: list[float], kept: bool) -> None:
    row = _watched_row("spray", "view1", [ViewDisparity(one_px, 0.005) for one_px in disparities_px], drift_px)
    assert row.kept is kept
    if np.all(np.isfinite(disparities_px)):
        assert row.maximum == pytest.approx(np.max(np.abs(np.subtract(disparities_px, drift_px))))
    else:
        assert row.value is None


def test_every_view_drifts_elsewhere() -> None:
    directions = np.array([direction(number) for number in range(4)])
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    cosines = (directions @ directions.T)[np.triu_indices(4, 1)]
    assert np.abs(cosines).max() < np.cos(np.deg2rad(30))
