"""Round droplets close to each other: what they explain is no ligament, what they do not explain is one."""

from dataclasses import replace

import numpy as np
import pytest

from processing.analysis.droplets.droplet_table import SizedDroplets
from processing.analysis.objects.liquid_objects import ObjectClass
from processing.analysis.objects.object_search import ExposureObjects, ObjectSearch, measure_objects, plan_objects
from processing.analysis.objects.told_droplets import without_told
from processing.geometry import FloatArray
from processing.studies.simulated_droplets import study_cameras, study_grid
from tests.support.shadow_scenes import BLURS_PX, scale_px_per_mm, united_shadow

SIZE_PX = (200, 140)
CAMERAS = study_cameras(SIZE_PX)
PAIR_MM, DIAMETERS_MM = np.array([[0.0, 0.0, -0.075], [0.01, 0.02, 0.075]]), np.array([0.1, 0.1])
"""Two balls, 50 um apart along the sight of the middle views."""
THREAD_MM = np.linspace([-0.2, -0.1, 0.0], [0.2, 0.1, 0.0], 40)


@pytest.fixture(scope="module")
def search() -> ObjectSearch:
    return plan_objects(CAMERAS, study_grid((90, 90, 90)))


def _found(search: ObjectSearch, points_mm: FloatArray, diameters_mm: FloatArray) -> ExposureObjects:
    """What the views tell of balls, by an oracle's images of them."""
    images = []
    for camera, blur_px in zip(CAMERAS, BLURS_PX, strict=True):
        radii_px = 0.5 * diameters_mm * scale_px_per_mm(camera, points_mm)
        shadow = united_shadow(camera.project(points_mm), radii_px, blur_px, SIZE_PX)
        images.append(shadow.astype(np.float32))
    return measure_objects(images, search)


def _told(points_mm: FloatArray, diameters_mm: FloatArray) -> SizedDroplets:
    nothing, many = SizedDroplets.none(), np.zeros(len(points_mm))
    return replace(nothing, points_mm=points_mm, diameters_um=1000 * diameters_mm, views=many.astype(np.int64))


@pytest.fixture(scope="module")
def pair(search: ObjectSearch) -> ExposureObjects:
    found = _found(search, PAIR_MM, DIAMETERS_MM)
    assert found.objects.count(ObjectClass.LIGAMENT) == 1, "else the tests below say nothing"
    return found


def test_two_droplets_that_are_told_are_no_ligament(search: ObjectSearch, pair: ExposureObjects) -> None:
    left = without_told(pair, _told(PAIR_MM, DIAMETERS_MM), search)
    assert (len(left.objects), len(left.bodies)) == (0, 0)


@pytest.mark.parametrize("told", [[], [0], [1]])
def test_what_one_of_them_explains_alone_stays(search: ObjectSearch, pair: ExposureObjects, told: list[int]) -> None:
    left = without_told(pair, _told(PAIR_MM[told], DIAMETERS_MM[told]), search)
    assert (len(left.objects), len(left.bodies)) == (1, 1)


def test_droplets_that_are_too_small_for_it_leave_it(search: ObjectSearch, pair: ExposureObjects) -> None:
    assert len(without_told(pair, _told(PAIR_MM, 0.6 * DIAMETERS_MM), search).objects) == 1


def test_a_thread_that_ends_as_three_droplets_stays_a_ligament(search: ObjectSearch) -> None:
    found = _found(search, THREAD_MM, np.full(len(THREAD_MM), 0.05))
    assert found.objects.count(ObjectClass.LIGAMENT) == 1
    left = without_told(found, _told(THREAD_MM[[2, 20, 37]], np.full(3, 0.05)), search)
    assert left.objects.count(ObjectClass.LIGAMENT) == 1
