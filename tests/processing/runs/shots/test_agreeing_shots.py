"""Self-calibration by shots that do not tell the same, or in which depth is reversed, refuses instead of correcting."""

from collections.abc import Callable

import numpy as np
import pytest

from processing.calibration.errors import CalibrationError
from processing.runs.shots.agreeing_shots import corrected_by
from processing.runs.shots.shot_check import Exposure
from tests.support.drifting_views import SIZE_PX, calibration_of, droplet_shots, views

pytestmark = pytest.mark.slow

CALIBRATION = calibration_of(views())
SHOTS = 4
Change = Callable[[list[Exposure]], None]


def shots(change: Change) -> dict[int, list[Exposure]]:
    """Double exposures of a uniform spray by number of shot; something was changed in them."""
    exposures = [list(seen) for seen in droplet_shots(2 * SHOTS, 7.0)]
    change(exposures)
    return {number: exposures[2 * number : 2 * number + 2] for number in range(SHOTS)}


def drifted(first: int, last: int, drift_px: float) -> Change:
    def change(exposures: list[Exposure]) -> None:
        for seen in exposures[2 * first : 2 * last + 2]:
            seen[1] = seen[1] + (drift_px, 0)

    return change


def next_b(exposures: list[Exposure]) -> None:
    for shot in range(SHOTS - 1):
        exposures[2 * shot + 1][1] = exposures[2 * shot + 3][1]


def mirrored(exposures: list[Exposure]) -> None:
    for seen in exposures:
        seen[:] = [np.column_stack([SIZE_PX[0] - 1 - one[:, 0], one[:, 1]]) for one in seen]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (next_b, r"3 of 4 shots .* shot 0: exposure B by itself: view2 has moved further than 3 px, or shows other"),
        (drifted(3, 3, 2.5), r"1 of 4 shots that were asked by .* all tell together: shot 3"),
        (mirrored, r"all images are mirrored left to right, .* depth is reversed. No view has moved"),
    ],
    ids=["B is of the next shot", "moved late", "mirrored"],
)
def test_shots_that_do_not_tell_the_same_correct_nothing(change: Change, said: str) -> None:
    with pytest.raises(CalibrationError, match=said):
        corrected_by(shots(change), CALIBRATION, "run")
