"""What a calibration says against itself goes with all that is made by it; its hold-out error droplets tell anew."""

from dataclasses import replace

import pytest

from processing.calibration.verdict import Verdict
from processing.runs.shots.stated_lengths import own_doubt
from tests.support.drifting_views import calibration_of, views

HOLDOUT = "hold-out error 0.4 px, above 0.3 px"
SCALE = "the scale is 15 % off the stated one"


@pytest.mark.parametrize(
    ("holdout_px", "reasons", "told"),
    [
        (0.02, (SCALE,), f": warn: {SCALE}"),
        (0.1, (SCALE,), f": warn: {SCALE}"),
        (0.4, (HOLDOUT,), ""),
        (0.02, (), ": warn"),
    ],
    ids=["good", "corrected by droplets", "hold-out alone", "from before reasons were kept"],
)
def test_all_but_the_holdout_error_is_told(holdout_px: float, reasons: tuple[str, ...], told: str) -> None:
    good = calibration_of(views())
    view = replace(good.views["view2"], verdict=Verdict.WARN, holdout_error_px=holdout_px, reasons=reasons)
    doubt = own_doubt(replace(good, views={**good.views, "view2": view}), good.views)
    assert doubt.endswith(told)
    assert bool(doubt) is bool(told)
    assert own_doubt(good, good.views) == ""
