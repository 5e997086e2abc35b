"""What a calibration says against itself goes with all that is made by it; its hold-out error droplets tell anew."""

from dataclasses import replace

import pytest

from processing.calibration.verdict import Verdict
from processing.runs.shots.stated_lengths import own_doubt
from tests.support.drifting_views import calibration_of, views

HOLDOUT = "hold-out error 0.4 px, above 0.3 px"
NOT_SEEN = "70 points that were left out lie on one spot (0, 0): were these not seen?"
SCALE = "the scale is 15 % off the stated one"


@pytest.mark.parametrize(
    ("holdout_px", "reasons", "told"),
    [
        (0.02, (SCALE,), SCALE),
        (0.1, ("hold-out error 0.1 px, above 0.05 px", SCALE), SCALE),
        (0.4, (HOLDOUT, SCALE), SCALE),
        (0.4, (HOLDOUT,), ""),
        (0.4, (HOLDOUT, NOT_SEEN), ""),
        (0.02, (), ""),
    ],
    ids=["good", "usable", "warn", "hold-out alone", "not seen", "kept no reasons"],
)
def test_all_but_the_holdout_error_is_told(holdout_px: float, reasons: tuple[str, ...], told: str) -> None:
    good = calibration_of(views())
    view = replace(good.views["view2"], verdict=Verdict.WARN, holdout_error_px=holdout_px, reasons=reasons)
    doubt = own_doubt(replace(good, views={**good.views, "view2": view}), good.views)
    assert doubt.endswith(told)
    assert bool(doubt) is bool(told)
    assert own_doubt(good, good.views) == ""
