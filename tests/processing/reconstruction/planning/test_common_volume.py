"""The default grid: seen by all views, as large as can be, one voxel per pixel."""

from itertools import combinations_with_replacement, product

import numpy as np
import pytest

from processing.geometry import PinholeCamera, view_camera
from processing.reconstruction.errors import ReconstructionError
from processing.reconstruction.planning.common_volume import common_volume, largest_box, largest_rectangle, share_within
from processing.volume import VoxelGrid


def common(pitch_mm: float | None = None) -> VoxelGrid:
    return common_volume(
        cameras(), x_range_mm=(-20, 20), y_range_mm=(-15, 15), z_range_mm=(-4.5, 4.5), pitch_mm=pitch_mm
    )


def cameras() -> list[PinholeCamera]:
    return [
        view_camera(azimuth_deg, focal_length_mm=85, magnification=0.43, scale_px_per_mm=60)
        for azimuth_deg in (45, 15, -15, -45)
    ]


def test_every_corner_is_seen_by_every_view() -> None:
    grid = common()
    corners_mm = np.array(
        [[x, y, z] for x in grid.x_mm[[0, -1]] for y in grid.y_mm[[0, -1]] for z in grid.z_mm[[0, -1]]]
    )
    for camera in cameras():
        image_px = camera.project(corners_mm)
        assert (image_px >= 0).all()
        assert (image_px <= [1599, 1199]).all()


def test_the_papers_volume_fits_in() -> None:
    grid = common()
    assert grid.pitch_mm == pytest.approx(1 / 60, rel=0.01)
    assert np.ptp(grid.x_mm) > 18
    assert np.ptp(grid.y_mm) > 17.25
    assert np.ptp(grid.z_mm) == pytest.approx(9, abs=0.02)


def test_a_stated_pitch_is_kept() -> None:
    assert common(pitch_mm=0.1).pitch_mm == 0.1


def test_views_without_a_common_volume_are_refused() -> None:
    with pytest.raises(ReconstructionError, match="2 views see no common volume within x"):
        common_volume(cameras()[:2], x_range_mm=(200, 240), y_range_mm=(-15, 15), z_range_mm=(-4, 4))


def test_largest_rectangle_of_a_mask_with_a_hole() -> None:
    mask = np.ones((6, 8), dtype=bool)
    mask[2, 3] = False
    assert largest_rectangle(mask) == (0, 5, 4, 7)
    assert largest_rectangle(np.zeros((3, 3), dtype=bool)) is None


def test_views_from_all_sides_get_a_box_that_ends_before_the_calibrated_depth() -> None:
    """At 120 mm a view sees 25.2 mm: the whole depth of the cube in a sliver of 2 mm only, or 22 mm each way."""
    around = [
        view_camera(azimuth_deg, focal_length_mm=40, magnification=0.5, scale_px_per_mm=20, image_size_px=(504, 504))
        for azimuth_deg in (90, -90, 0, 180)
    ]
    cube_mm = (-12.5, 12.5)
    grid = common_volume(around, x_range_mm=cube_mm, y_range_mm=cube_mm, z_range_mm=cube_mm, pitch_mm=0.5)
    extents_mm = [np.ptp(axis_mm) for axis_mm in (grid.x_mm, grid.y_mm, grid.z_mm)]
    corners_mm = np.array(list(product(*(axis_mm[[0, -1]] for axis_mm in (grid.x_mm, grid.y_mm, grid.z_mm)))))
    for camera in around:
        image_px = camera.project(corners_mm)
        assert ((image_px >= 0) & (image_px <= 503)).all()
    assert min(extents_mm) > 20, "of a cube of 25 mm"


def test_largest_box_beats_every_other_box() -> None:
    seen = np.random.default_rng(3).random((4, 5, 6)) < 0.85
    box = largest_box(seen)
    assert box is not None
    first, last, top, bottom, left, right = box
    assert seen[first : last + 1, top : bottom + 1, left : right + 1].all()
    sizes = [
        (z1 - z0) * (y1 - y0 + 1) * (x1 - x0 + 1)
        for (z0, z1), (y0, y1), (x0, x1) in product(*(combinations_with_replacement(range(n), 2) for n in seen.shape))
        if seen[z0 : z1 + 1, y0 : y1 + 1, x0 : x1 + 1].all()
    ]
    assert (last - first) * (bottom - top + 1) * (right - left + 1) == max(sizes)
    assert largest_box(np.zeros((3, 3, 3), dtype=bool)) is None


def test_the_share_of_a_box_counts_what_lies_in_both() -> None:
    grid = VoxelGrid((11, 11, 11), (-0.5, 0.0, 0.0), 0.1)
    assert share_within(grid, (-1, 1), (0, 1), (0.5, 1.5)) == pytest.approx(0.5 * 1 * 0.5)
    assert share_within(grid, (5, 6), (0, 1), (0, 1)) == 0
