"""What a shot says of the views: which one has moved, how far, or too far; or that it is not one alone."""

from collections.abc import Callable

import numpy as np
import pytest

from processing.calibration.droplets.disparity import ViewDisparity, measured_box, shot_disparity
from processing.calibration.verdict import Verdict
from processing.geometry import FloatArray, PinholeCamera
from processing.runs.shots.shot_check import ALARM_PX, FEW_SEEDS, ShotCheck, check_shots
from processing.runs.shots.turned_views import meeting_sights
from processing.studies.drifting_views import direction
from processing.studies.seen_droplets import droplet_calibration
from processing.studies.simulated_droplets import study_cameras
from tests.support.drifting_views import SIZE_PX, calibration_of, check_one, droplet_shots, inside_mm, views

pytestmark = pytest.mark.slow

CALIBRATION = calibration_of(views())
MAPPINGS = [view.mapping for view in CALIBRATION.views.values()]


def checked(drifts_px: dict[int, tuple[float, float]], count: int = 120) -> ShotCheck:
    """A shot of droplets that are seen to a twentieth of a pixel; some views have moved."""
    rng = np.random.default_rng(5)
    seen: list[FloatArray] = []
    for view, mapping in enumerate(MAPPINGS):
        image_px = mapping.project(inside_mm(count)) + drifts_px.get(view, (0.0, 0.0))
        seen.append(image_px + rng.normal(0, 0.05, image_px.shape))
    return check_one([seen], CALIBRATION)


def photographed(density_per_mm3: float, view: int = 0, drift_px: float = 0.0) -> ShotCheck:
    """Two exposures of a uniform spray as the views see it; one view has moved."""
    exposures = [list(seen) for seen in droplet_shots(2, density_per_mm3)]
    for seen in exposures:
        seen[view] = seen[view] + drift_px * direction(view)
    return check_one(exposures, CALIBRATION)


@pytest.mark.parametrize("drift_px", [(0.45, 0.0), (0.0, -0.45), (1.5, 1.0)])
@pytest.mark.parametrize("view", range(4))
def test_the_view_that_moved_is_named_and_its_disparity_is_its_drift(view: int, drift_px: tuple[float, float]) -> None:
    check = checked({view: drift_px})
    assert check.moved == f"view{view + 1}"
    assert check.views[check.moved].disparity_px == pytest.approx(np.hypot(*drift_px), abs=0.06)
    assert check.views[check.moved].left_px < 0.03


@pytest.mark.parametrize(("drift_px", "enough"), [(0.0, True), (0.5, False)])
def test_few_droplets_are_enough_where_they_agree_beyond_doubt(drift_px: float, enough: bool) -> None:
    exposures = [[seen.copy() for seen in one] for one in droplet_shots(2, 14.0)]
    for seen in exposures:
        seen[0] += drift_px * direction(0)
    assert all(len(seen) > FEW_SEEDS for one in exposures for seen in one)
    by_all = shot_disparity(MAPPINGS, exposures, measured_box(CALIBRATION))
    told = check_one(exposures, CALIBRATION)
    assert (tuple(told.views.values()) != by_all) == enough
    assert (told.worst_px < ALARM_PX) == (max(view.disparity_px for view in by_all) < ALARM_PX) == enough


@pytest.mark.parametrize("exposure", [0, 1])
@pytest.mark.parametrize("view", range(4))
def test_an_exposure_that_shows_other_droplets_is_not_hidden_by_the_other_one(exposure: int, view: int) -> None:
    """A camera that lost a frame: in one view exposure B is that of the shot before."""
    exposures = [list(seen) for seen in droplet_shots(3, 7.0)]
    exposures[exposure][view] = exposures[2][view]
    check = check_one(exposures[:2], CALIBRATION)
    assert (check.verdict, check.moved) == (Verdict.REFUSE, f"view{view + 1}")
    assert check.problem.startswith(f"exposure {'AB'[exposure]} by itself: view{view + 1} has moved")


@pytest.mark.parametrize("drift_px", [1.2, 2.5])
def test_a_view_that_shook_in_one_exposure_is_not_hidden_by_the_other_one(drift_px: float) -> None:
    exposures = [list(seen) for seen in droplet_shots(2, 7.0)]
    exposures[1][2] = exposures[1][2] + drift_px * direction(2)
    assert check_one(exposures, CALIBRATION).verdict is Verdict.REFUSE


def mirrored(seen: list[FloatArray]) -> list[FloatArray]:
    return [np.column_stack([SIZE_PX[0] - 1 - one[:, 0], one[:, 1]]) for one in seen]


def half_turned(seen: list[FloatArray]) -> list[FloatArray]:
    return [SIZE_PX - np.array([1, 1]) - one for one in seen]


@pytest.mark.parametrize(
    ("turned", "said"),
    [
        (mirrored, "all images are mirrored left to right, or turned by 180 degrees"),
        (half_turned, "all images are mirrored left to right, or turned by 180 degrees"),
        (lambda seen: seen[::-1], "views are exchanged, view1 with view4, view2 with view3"),
    ],
)
def test_depth_that_is_reversed_is_named(turned: Callable[[list[FloatArray]], list[FloatArray]], said: str) -> None:
    """Seen from far away all lines of sight would meet as well; perspective leaves a few tenths of a pixel."""
    check = check_one([turned(list(seen)) for seen in droplet_shots(2, 7.0)], CALIBRATION)
    assert check.verdict is Verdict.REFUSE
    assert said in check.problem


def test_shots_of_a_run_tell_together_that_depth_is_reversed_where_each_has_too_few_droplets() -> None:
    exposures = [mirrored(list(seen)) for seen in droplet_shots(6, 0.5)]
    by_shot = {shot: exposures[2 * shot : 2 * shot + 2] for shot in range(3)}
    assert not any("reversed" in check_one(one, CALIBRATION).problem for one in by_shot.values())
    with_a_lens_covered = {7: [[*exposures[0][:3], np.empty((0, 2))]], **by_shot}
    checks = check_shots(with_a_lens_covered, CALIBRATION)
    assert [check.shot for check in checks] == [7, 0, 1, 2]
    assert all(check.problem.endswith("depth is reversed") for check in checks)
    assert {check.verdict for check in checks} == {Verdict.REFUSE}


def test_no_more_exposures_are_asked_for_depth_than_are_enough() -> None:
    """What is told counts droplets."""
    exposures = [mirrored(list(seen)) for seen in droplet_shots(6, 7.0)]
    assert meeting_sights(CALIBRATION, exposures) == meeting_sights(CALIBRATION, exposures[:2]) != {}


WIDE_PX, WIDE_MM = (800, 500), np.array([4.2, 1.7, 2.5])


def wide(
    change: Callable[[list[FloatArray]], list[FloatArray]], count: int, noise_px: float, seen_share: float, seed: int
) -> ShotCheck:
    """Droplets of a volume so wide that disparities of mirrored views cancel in its parts; some are not found."""
    cameras, rng = study_cameras(WIDE_PX), np.random.default_rng(seed)
    points_mm = rng.uniform(-WIDE_MM, WIDE_MM, (count, 3))
    seen = []
    for camera in cameras:
        found = rng.random(count) < seen_share
        noise = rng.normal(0, 1, (count, 2)) * rng.lognormal(0, 0.7, (count, 1))
        seen.append((camera.project(points_mm) + noise_px * noise)[found])
    return check_one([change(seen)], droplet_calibration(cameras, WIDE_MM))


def view2_turned(seen: list[FloatArray]) -> list[FloatArray]:
    """By a tenth of a degree about its axis."""
    angle, middle_px = np.deg2rad(0.1), (np.array(WIDE_PX) - 1) / 2
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return [seen[0], (seen[1] - middle_px) @ turn + middle_px, *seen[2:]]


def all_mirrored(seen: list[FloatArray]) -> list[FloatArray]:
    return [np.column_stack([WIDE_PX[0] - 1 - one[:, 0], one[:, 1]]) for one in seen]


def test_a_view_that_was_turned_is_no_reversed_depth() -> None:
    check = wide(view2_turned, 900, 0.15, 1.0, 5)
    assert "depth is reversed" not in check.problem
    assert check.views["view2"].disparity_px == pytest.approx(0.23, abs=0.1)


def test_depth_that_is_reversed_shows_where_disparities_cancel() -> None:
    check = wide(all_mirrored, 400, 0.08, 0.75, 2)
    assert check.verdict is Verdict.REFUSE
    assert "if all images are mirrored left to right" in check.problem
    assert not wide(lambda seen: seen, 400, 0.08, 0.75, 2).beyond


def test_two_that_moved_are_not_blamed_on_one() -> None:
    check = checked({0: (0.0, 0.7), 2: (0.8, -0.6)})
    assert check.worst_px > 0.5
    assert check.moved is None


def test_small_disparities_are_blamed_on_nobody() -> None:
    check = checked({1: (0.2, 0.0)})
    assert check.worst_px == pytest.approx(0.2, abs=0.05)
    assert check.moved is None


@pytest.mark.parametrize("drift_px", [12.0, 30.0, 100.0])
@pytest.mark.parametrize("view", range(4))
def test_a_view_that_moved_out_of_range_stops_without_a_figure(view: int, drift_px: float) -> None:
    check = photographed(2.0, view, drift_px)
    assert (check.verdict, check.moved, check.views) == (Verdict.REFUSE, f"view{view + 1}", {})
    assert check.problem.startswith(f"view{view + 1} has moved further than 3 px, or shows other droplets")


@pytest.mark.parametrize("drift_px", [4.5, 5.0, 6.0, 8.0])
@pytest.mark.parametrize("view", range(4))
def test_what_is_measured_beyond_the_reach_is_true(view: int, drift_px: float) -> None:
    check = photographed(2.0, view, drift_px)
    assert check.verdict is Verdict.REFUSE
    assert check.moved == f"view{view + 1}"
    if check.views:
        assert check.views[check.moved].disparity_px == pytest.approx(drift_px, abs=0.1)


@pytest.mark.parametrize("density_per_mm3", [0.7, 7.0, 14.0])
def test_few_and_many_droplets_tell_of_a_view_out_of_range(density_per_mm3: float) -> None:
    assert photographed(density_per_mm3, 1, 30.0).moved == "view2"


def test_a_view_near_the_end_of_the_range_stops_without_a_figure() -> None:
    check = photographed(2.0, 1, 5.3)
    assert (check.verdict, check.views) == (Verdict.REFUSE, {})
    assert "view2" in check.beyond


def test_views_none_of_which_agree_are_an_alarm() -> None:
    check = checked({0: (20.0, 10.0), 1: (-15.0, 25.0)}, count=400)
    assert (check.verdict, check.moved, check.beyond) == (Verdict.WARN, None, tuple(CALIBRATION.views))
    assert check.problem.endswith("several views have moved further than 3 px, or most spots are noise")


def test_spots_of_noise_do_not_stop_reconstruction() -> None:
    """Images without a droplet: as many spots as noise makes, in each view elsewhere."""
    rng = np.random.default_rng(11)
    spots = [rng.uniform(0, mapping.image_size_px, (800, 2)) for mapping in MAPPINGS]
    assert check_one([spots], CALIBRATION).verdict in (Verdict.WARN, None)


@pytest.mark.parametrize("density_per_mm3", [0.5, 2.0, 7.0, 14.0, 20.0, 28.0, 40.0])
def test_views_in_place_raise_no_alarm_however_dense_the_spray(density_per_mm3: float) -> None:
    assert photographed(density_per_mm3).verdict in (Verdict.GOOD, Verdict.USABLE, None)


@pytest.mark.parametrize(
    ("uncertainty_px", "verdict"), [(0.01, Verdict.WARN), (0.075, Verdict.USABLE)], ids=["many", "few droplets"]
)
def test_only_what_is_certain_of_a_disparity_is_judged(uncertainty_px: float, verdict: Verdict) -> None:
    """0.317 ± 0.075 px was measured of views in place, at 18 droplets/mm3."""
    check = ShotCheck(0, {"view1": ViewDisparity(0.1, 0.02), "view2": ViewDisparity(0.317, uncertainty_px)})
    assert check.verdict is verdict


@pytest.mark.parametrize(("density_per_mm3", "drift_px"), [(0.0, 0.0), (0.05, 0.0), (0.05, 30.0)])
def test_too_few_droplets_do_not_tell(density_per_mm3: float, drift_px: float) -> None:
    check = photographed(density_per_mm3, 2, drift_px)
    assert (check.verdict, check.moved, check.beyond) == (None, None, ())
    assert check.problem.endswith("too few droplets, or too many, to tell whether a view has moved")


def test_a_view_that_sees_nothing_has_not_moved() -> None:
    (seen,) = droplet_shots(1, 2.0)
    assert check_one([[*seen[:3], np.empty((0, 2))]], CALIBRATION).verdict is None


REFRACTIVE_INDEX = 1.52


def behind_glass(points_mm: FloatArray, camera: PinholeCamera, thickness_mm: float) -> FloatArray:
    """Where points seem to be behind a plate across z: Snell's law shifts each line of sight along z."""
    towards = np.array([0.0, 0.0, np.sign(camera.centre_mm[2])])
    seen_mm = points_mm
    for _ in range(20):
        sights = camera.centre_mm - seen_mm
        cosines = np.abs(sights[:, 2]) / np.linalg.norm(sights, axis=1)
        shifts_mm = thickness_mm * (1 - cosines / np.sqrt(REFRACTIVE_INDEX**2 - 1 + cosines**2))
        seen_mm = points_mm + shifts_mm[:, None] * towards
    return seen_mm


@pytest.mark.parametrize("thickness_mm", [0.5, 1.0, 2.0, 3.0, 10.0])
def test_a_window_that_came_after_the_calibration_is_no_good_one(thickness_mm: float) -> None:
    cameras = [mapping for mapping in MAPPINGS if isinstance(mapping, PinholeCamera)]
    seen = [camera.project(behind_glass(inside_mm(120), camera, thickness_mm)) for camera in cameras]
    assert check_one([seen], CALIBRATION).verdict in (Verdict.WARN, Verdict.REFUSE)


@pytest.mark.parametrize("offset_px", [(4.0, 0.0), (40.0, 0.0), (16.0, 8.0)])
def test_images_that_are_cropped_elsewhere_do_not_fit(offset_px: tuple[float, float]) -> None:
    assert checked(dict.fromkeys(range(4), offset_px)).verdict in (Verdict.WARN, Verdict.REFUSE)
