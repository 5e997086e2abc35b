"""Views that see other droplets than all others are told by how rarely lines of sight meet, without any figure."""

import pytest

from processing.calibration.droplets.agreement import strangers
from processing.calibration.droplets.disparity import measured_box
from processing.calibration.verdict import Verdict
from processing.geometry import FloatArray
from tests.support.drifting_views import calibration_of, check_one, inside_mm, views

CALIBRATION = calibration_of(views())
MAPPINGS = [view.mapping for view in CALIBRATION.views.values()]
BOX = measured_box(CALIBRATION)


def seen(count: int, mirrored: tuple[int, ...] = ()) -> list[FloatArray]:
    """Droplets as true cameras see them; some images are flipped left to right."""
    points_mm, width_px = inside_mm(count), MAPPINGS[0].image_size_px[0]
    exact = [mapping.project(points_mm) for mapping in MAPPINGS]
    return [px * (-1, 1) + (width_px - 1, 0) if view in mirrored else px for view, px in enumerate(exact)]


@pytest.mark.parametrize("n_views", [3, 4])
@pytest.mark.parametrize("count", [40, 400])
def test_views_in_place_are_no_strangers(n_views: int, count: int) -> None:
    assert strangers(MAPPINGS[:n_views], [seen(count)[:n_views]], BOX) == []


@pytest.mark.parametrize(("n_views", "named"), [(3, [0, 1, 2]), (4, [1])])
def test_a_mirrored_view_is_named_where_the_others_can_tell(n_views: int, named: list[int]) -> None:
    assert strangers(MAPPINGS[:n_views], [seen(150, mirrored=(1,))[:n_views]], BOX) == named


def test_a_handful_of_droplets_does_not_tell() -> None:
    assert strangers(MAPPINGS, [seen(8, mirrored=(1,))], BOX) == []


def test_a_thousand_droplets_that_disagree_are_an_alarm_however_close_they_are() -> None:
    """Their neighbours stand less than 12 px apart; in three views no view can be named."""
    three = calibration_of(views()[:3])
    check = check_one([seen(1000, mirrored=(1,))[:3]], three)
    assert (check.verdict, check.beyond) == (Verdict.WARN, tuple(three.views))
    assert check.problem.endswith("several views have moved further than 3 px, or most spots are noise")
    assert check_one([seen(1000)[:3]], three).verdict in (Verdict.GOOD, Verdict.USABLE, None)
