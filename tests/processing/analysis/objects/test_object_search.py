"""What views see at all, and what pixels that know nothing do: they are no evidence for liquid, nor against it."""

import numpy as np
import pytest
from scipy.special import ndtr

from processing.analysis.objects.object_search import ObjectSearch, all_objects, measure_objects, plan_objects
from processing.analysis.objects.seeing_views import UnseenMap, map_grid, unknown_shares
from processing.geometry import FloatArray, ViewMapping
from processing.preprocessing import Intensity
from processing.studies.simulated_droplets import study_cameras, study_grid
from processing.volume import VoxelGrid

GRID, SIZE_PX = study_grid((90, 90, 90)), (200, 140)


@pytest.fixture(scope="module")
def search() -> ObjectSearch:
    return plan_objects(study_cameras(SIZE_PX), GRID)


def _images(views: int = 4) -> list[Intensity]:
    return [np.ones(SIZE_PX[::-1], np.float32) for _ in range(views)]


def test_all_views_see_an_empty_volume_and_find_nothing(search: ObjectSearch) -> None:
    found = measure_objects(_images(), search)
    assert (found.unseen.percent == 0).all()
    assert (found.blind_share, found.unjudged_share, len(found.objects)) == (0.0, 0.0, 0)
    assert "--nozzle" in (found.reach.reason or "")


def test_a_black_half_of_two_views_leaves_two(search: ObjectSearch) -> None:
    images = _images()
    for image in images[:2]:
        image[70:] = 0.02
    found = measure_objects(images, search)
    upper, lower = found.unseen.percent[:2], found.unseen.percent[-2:]
    assert (upper == 0).all()
    assert (lower == 100).all()
    assert found.unjudged_share == pytest.approx(0.5, abs=0.15)
    assert found.blind_share == 0


def test_pixels_that_know_nothing_are_no_liquid(search: ObjectSearch) -> None:
    trust = _images()
    for sure in trust:
        sure[:70] = 0
    found = measure_objects(_images(), search, trust=trust)
    assert len(found.objects) == 0
    assert found.blind_share == pytest.approx(0.5, abs=0.15)


def test_one_view_that_knows_nothing_says_nothing_against_what_others_see(search: ObjectSearch) -> None:
    images, trust = _images(), _images()
    for image in images[:3]:
        image[60:80, 40:160] = 0.1
    trust[3][:] = 0
    assert len(measure_objects(images, search).objects) == 0
    assert measure_objects(images, search, trust=trust).objects.open.any()


@pytest.mark.parametrize("blur_px", [0.7, 1.2, 2.0])
@pytest.mark.parametrize("diameter_px", [5.0, 8.0, 16.0])
def test_a_blurred_thread_is_as_wide_as_it_is(search: ObjectSearch, diameter_px: float, blur_px: float) -> None:
    """Blur makes the edge of what is a third dark wider than the edge, and a silhouette is made of whole voxels."""
    pixel_mm = GRID.pitch_mm
    images = [_thread_image(camera, 0.5 * diameter_px, 0.4, blur_px) for camera in search.mappings]
    found = measure_objects(images, search).objects
    assert found.classes.tolist() == ["ligament"]
    sd_mm, diameter_mm = float(found.length_sd_mm[0]), diameter_px * pixel_mm
    np.testing.assert_allclose(found.lengths_mm, 0.8, atol=2 * sd_mm)
    across_mm = np.array([found.widths_mm[0], found.thicknesses_mm[0]])
    np.testing.assert_allclose(across_mm.mean(), diameter_mm, atol=0.8 * sd_mm)
    np.testing.assert_allclose(across_mm, diameter_mm, atol=2 * sd_mm)


def _thread_image(camera: ViewMapping, radius_px: float, half_length_mm: float, blur_px: float) -> Intensity:
    """Light behind a thread along y in the middle, with the edges of a Gaussian blur: by its formula."""
    ends = camera.project(np.array([[0.0, -half_length_mm, 0.0], [0.0, half_length_mm, 0.0]]))
    row, column = np.mgrid[: SIZE_PX[1], : SIZE_PX[0]]
    across = _blurred_slit(column, ends[0, 0] - radius_px, ends[0, 0] + radius_px, blur_px)
    return (1 - across * _blurred_slit(row, ends[0, 1], ends[1, 1], blur_px)).astype(np.float32)


def _blurred_slit(places: FloatArray, low: float, high: float, blur_px: float) -> FloatArray:
    return np.asarray(ndtr((high - places) / blur_px) - ndtr((low - places) / blur_px))


def test_two_views_do_not_tell_shapes() -> None:
    cameras = study_cameras(SIZE_PX)[:2]
    found = measure_objects(_images(2), plan_objects(cameras, GRID))
    assert found.reason == "2 views do not tell shapes: 3 or more do"


def test_a_volume_that_is_all_dark_says_so(search: ObjectSearch, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("processing.analysis.objects.dark_voxels.MOST_VOXELS", 1000)
    found = measure_objects([0 * image for image in _images()], search)
    assert "voxels are dark in all views" in (found.reason or "")
    assert found.reach.reason == found.reason
    assert found.blind_share == 1.0


def test_nothing_dark_is_no_object(search: ObjectSearch) -> None:
    assert len(all_objects(_images(), search)) == 0


def test_places_of_the_map_lie_within_the_grid_and_in_its_middle() -> None:
    places = map_grid(GRID)
    for one, all_of_it in ((places.x_mm, GRID.x_mm), (places.y_mm, GRID.y_mm), (places.z_mm, GRID.z_mm)):
        assert all_of_it[0] <= one[0] <= one[-1] <= all_of_it[-1]
        np.testing.assert_allclose(one[0] + one[-1], all_of_it[0] + all_of_it[-1], atol=1e-9)


def test_shares_count_places_by_views() -> None:
    seeing = np.array([[[0, 1, 2, 3, 4]]], np.uint8)
    assert unknown_shares(seeing, 4) == (0.2, 0.6)
    assert unknown_shares(seeing, 2) == (0.2, 0.4)


def test_a_map_of_many_places_is_kept_coarser_and_means_the_same() -> None:
    places = VoxelGrid((2, 50, 90), (0.0, 0.0, 0.0), 0.1)
    seeing = np.full(places.shape, 4, np.uint8)
    seeing[0, :, :45] = 2
    unseen = UnseenMap.of(seeing, places)
    assert unseen.percent.shape == (25, 45)
    assert unseen.x_mm == pytest.approx((-0.05, 8.95))
    np.testing.assert_array_equal(unseen.percent[:, :22], 50)
    np.testing.assert_array_equal(unseen.percent[:, 23:], 0)
    again = UnseenMap.mean_of([unseen.told(), UnseenMap.of(np.full_like(seeing, 4), places).told()])
    np.testing.assert_array_equal(again.percent, unseen.percent / 2)
    np.testing.assert_array_equal(UnseenMap.of(np.full_like(seeing, 2), places, views=2).percent, 0)
