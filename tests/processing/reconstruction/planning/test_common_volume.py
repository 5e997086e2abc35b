"""The default grid: seen by all views, as large as can be, one voxel per pixel."""

import numpy as np
import pytest

from processing.geometry import PinholeCamera, view_camera
from processing.reconstruction.errors import ReconstructionError
from processing.reconstruction.planning.common_volume import common_volume, largest_rectangle
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
