"""Images without their blur, and how far liquid hangs together by them: gaps that blur bridges are seen."""

import cv2
import numpy as np
import pytest

from processing.analysis.objects.break_up import TELLING, Nozzle, Reach, at_nozzle, reach_of
from processing.analysis.objects.hull import darkness_of, hull_of
from processing.analysis.objects.object_search import ObjectSearch, measure_objects, plan_objects
from processing.analysis.objects.sharp_images import sharpened
from processing.analysis.objects.sharp_reach import box_around
from processing.preprocessing import Intensity
from processing.studies.simulated_droplets import study_cameras, study_grid
from processing.synthetic.paper_rig import paper_optics
from processing.synthetic.rendering import render_transmittance
from processing.synthetic.shadow_shots import Counting
from processing.synthetic.spray import Spray

GRID, SIZE_PX = study_grid((90, 120, 90)), (220, 180)
NOZZLE = Nozzle((0.0, -0.9, 0.0))
ENDS_MM, DIAMETER_MM = 0.0, 0.06
GAP_PX = 2.0


def _bars(gap_px: float, blur_px: float = 1.0) -> Intensity:
    """Two black bars, drawn eight times as fine, and blurred."""
    fine = np.zeros((8, 8 * 60), np.float32)
    half = round(4 * gap_px)
    fine[:, 80 : 240 - half] = fine[:, 240 + half : 400] = 1
    pixels = cv2.resize(cv2.GaussianBlur(fine, (0, 0), 8 * blur_px), (60, 1), interpolation=cv2.INTER_AREA)
    return np.repeat(pixels, 40, axis=0)


def test_a_gap_as_narrow_as_the_blur_is_seen_without_it() -> None:
    blurred = _bars(1.8)
    middle = slice(28, 32)
    assert blurred[20, middle].min() > max(TELLING) - 0.05
    sharp = sharpened(blurred)
    assert sharp[20, middle].min() < min(TELLING)
    np.testing.assert_allclose(sharp[20, [14, 20, 40, 46]], 1, atol=0.05)
    np.testing.assert_allclose(sharp[20, [4, 56]], 0, atol=0.02)


def test_nothing_is_said_beside_what_is_not_known() -> None:
    blurred, trust = _bars(1.8), np.ones((40, 60), np.float32)
    trust[:, 30] = 0
    unknown = np.where(trust > 0, blurred, np.float32(1))
    np.testing.assert_array_equal(sharpened(unknown, trust)[:, 28:33], unknown[:, 28:33])
    np.testing.assert_array_equal(sharpened(blurred, np.ones_like(blurred)), sharpened(blurred))


@pytest.mark.parametrize("level", [0.0, 1.0])
def test_an_image_without_edges_stays_as_it_is(level: float) -> None:
    image = np.full((30, 40), level, np.float32)
    np.testing.assert_allclose(sharpened(image), image, atol=1e-5)


@pytest.fixture(scope="module")
def search() -> ObjectSearch:
    return plan_objects(study_cameras(SIZE_PX), GRID, NOZZLE)


def _images(gap_px: float, last_mm: float = 0.6) -> list[Intensity]:
    """A thread from the nozzle on, and another one below it, so many pixels away."""
    step_mm = 0.35 * DIAMETER_MM
    begins_mm = ENDS_MM + DIAMETER_MM + gap_px * GRID.pitch_mm
    along_mm = np.concatenate([np.arange(ENDS_MM, -0.9, -step_mm), np.arange(begins_mm, last_mm, step_mm)])
    places_mm = np.stack([0 * along_mm, along_mm, 0 * along_mm], axis=1)
    spray, rng = Spray.of_droplets(places_mm, np.full(len(along_mm), DIAMETER_MM)), np.random.default_rng(3)
    return [
        Counting.of_noise(0.012).transmission(render_transmittance(camera, spray, view), rng)
        for camera, view in zip(study_cameras(SIZE_PX), paper_optics().values(), strict=True)
    ]


def _told_mm(reach: Reach) -> list[float]:
    return [mm - (ENDS_MM + DIAMETER_MM / 2 + 0.9) for mm in reach.reach_mm[: len(TELLING)]]


def test_threads_that_blur_bridges_are_told_apart(search: ObjectSearch) -> None:
    images = _images(GAP_PX)
    blurred = reach_of(hull_of(darkness_of(images, None), search.plan), NOZZLE)
    assert _told_mm(blurred)[0] > 0.5
    np.testing.assert_allclose(_told_mm(measure_objects(images, search).reach), 0, atol=0.04)


def test_a_thread_without_a_gap_stays_whole(search: ObjectSearch) -> None:
    reach = measure_objects(_images(-0.5), search).reach
    assert min(_told_mm(reach)) > 0.5
    assert reach.open == (False,) * 4


def test_only_the_box_of_what_may_hang_together_is_asked(search: ObjectSearch) -> None:
    hull = hull_of(darkness_of(_images(8.0), None), search.plan)
    body = at_nozzle(hull, NOZZLE)
    box = box_around(body, GRID.pitch_mm)
    assert np.prod(box.shape) < 0.1 * np.prod(GRID.shape)
    for points_mm, axis_mm in zip(body.points_mm.T, (box.x_mm, box.y_mm, box.z_mm), strict=True):
        assert axis_mm[0] < points_mm.min()
        assert points_mm.max() < axis_mm[-1]


def test_too_many_dark_voxels_leave_the_length_unknown_and_the_objects_told(
    search: ObjectSearch, monkeypatch: pytest.MonkeyPatch
) -> None:
    images = _images(8.0)
    coarse = len(hull_of(darkness_of(images, None), search.plan))
    monkeypatch.setattr("processing.analysis.objects.dark_voxels.MOST_VOXELS", coarse)
    found = measure_objects(images, search)
    assert found.reason is None
    assert found.reach.reason == f"more than {coarse} voxels are dark in all views"


def test_a_long_body_that_lies_apart_is_told(search: ObjectSearch) -> None:
    apart_mm = measure_objects(_images(8.0, last_mm=0.9), search).reach.apart_mm
    assert apart_mm is not None
    begins_mm = ENDS_MM + 0.5 * DIAMETER_MM + 8 * GRID.pitch_mm + 0.9
    np.testing.assert_allclose(apart_mm, (begins_mm, 1.8 + 0.5 * DIAMETER_MM), atol=0.05)
    assert measure_objects(_images(8.0, last_mm=0.3), search).reach.apart_mm is None
