"""Targets: edges and dots are seen where the camera projects them."""

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from processing.geometry import PinholeCamera, view_camera
from processing.synthetic.paper_rig import paper_cameras, paper_optics
from processing.synthetic.stamping import FloatArray
from processing.synthetic.target import Checkerboard, DotTarget, plane_coordinates, render_target
from tests.support.calibration_cases import target_plane_mm

CAMERAS, OPTICS = paper_cameras(), paper_optics()
BOARD = Checkerboard()


def edges_px(image: FloatArray, middles_px: FloatArray, slopes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Column of upright edges in the pixel row nearest to their projected middles: as projected, and as seen.

    The sum of grey values across an edge tells its place exactly: neither blur nor pixel changes it.
    """
    rows = np.rint(middles_px[:, 1]).astype(int)
    projected = middles_px[:, 0] + slopes * (rows - middles_px[:, 1])
    first = np.rint(projected).astype(int) - 8
    profiles = image[rows[:, None], first[:, None] + np.arange(17)]
    dark = (1 - profiles).sum(axis=1)
    seen = np.where(profiles[:, 0] < 0.5, first - 0.5 + dark, first + 16.5 - dark)
    return projected, seen


@pytest.mark.parametrize(("view", "z_mm"), [("view1", -4.5), ("view1", 4.5), ("view2", 0.0), ("view4", 3.0)])
def test_edges_are_seen_within_a_hundredth_pixel(view: str, z_mm: float) -> None:
    camera = CAMERAS[view]
    image = render_target(camera, BOARD, z_mm, OPTICS[view]).astype(float)
    corners_mm = target_plane_mm(z_mm)
    for turned, along in ((slice(None), np.array([0, 0.5, 0])), (slice(None, None, -1), np.array([0.5, 0, 0]))):
        middles_px = camera.project(corners_mm + along)[:, turned]
        steps_px = camera.project(corners_mm + 1.1 * along)[:, turned] - middles_px
        seen_image = image if along[1] else image.T
        projected, seen = edges_px(seen_image, middles_px, steps_px[:, 0] / steps_px[:, 1])
        np.testing.assert_allclose(seen, projected, atol=0.01)


@pytest.mark.parametrize("view", ["view1", "view3"])
def test_corners_are_points_of_symmetry(view: str) -> None:
    image = render_target(CAMERAS[view], BOARD, 2.0, OPTICS[view]).astype(float)
    offsets_px = np.stack(np.meshgrid(*[np.arange(-5, 6)] * 2), axis=-1).reshape(-1, 2)
    for corner_px in CAMERAS[view].project(target_plane_mm(2.0))[::17]:
        around = map_coordinates(image, (corner_px + offsets_px)[:, ::-1].T, order=5)
        np.testing.assert_allclose(around, around[::-1], atol=0.03)


def test_dots_are_seen_at_their_projected_centres() -> None:
    target, camera = DotTarget(), CAMERAS["view1"]
    dark = 1 - render_target(camera, target, -3.0, OPTICS["view1"]).astype(float)
    for expected_px in camera.project(target_plane_mm(-3.0))[::13]:
        column, row = np.rint(expected_px).astype(int)
        patch = dark[row - 18 : row + 19, column - 18 : column + 19]
        rows, columns = np.indices(patch.shape)
        found_px = [np.average(columns, weights=patch) + column - 18, np.average(rows, weights=patch) + row - 18]
        np.testing.assert_allclose(found_px, expected_px, atol=0.02)


def test_dots_have_their_area() -> None:
    camera = view_camera(0, focal_length_mm=85, magnification=0.43, scale_px_per_mm=60)
    target = DotTarget(columns=5, rows=3, diameter_mm=0.5)
    dark = 1 - render_target(camera, target, 0.0, OPTICS["view2"]).astype(float)
    assert dark.sum() == pytest.approx(15 * np.pi / 4 * 30**2, rel=0.005)


def test_board_is_half_dark_and_clear_around() -> None:
    camera = view_camera(0, focal_length_mm=85, magnification=0.43, scale_px_per_mm=60)
    image = render_target(camera, BOARD, 0.0, OPTICS["view2"]).astype(float)
    assert (1 - image).sum() == pytest.approx(0.5 * 24 * 18 * 60**2, rel=0.005)
    assert image[:, :60].min() > 0.999
    assert image.min() < 1e-3


def test_plane_coordinates_invert_the_projection_of_a_tilted_camera() -> None:
    straight = CAMERAS["view1"]
    camera = PinholeCamera(
        straight.camera_matrix, straight.rotation, straight.translation_mm, straight.image_size_px,
        straight.distortion, tilt_rad=(0.02, -0.05),
    )  # fmt: skip
    x_mm, y_mm = plane_coordinates(camera, 3.0)
    pixels = np.random.default_rng(0).integers(0, [1600, 1200], (200, 2))
    points_mm = np.column_stack([x_mm[pixels[:, 1], pixels[:, 0]], y_mm[pixels[:, 1], pixels[:, 0]], np.full(200, 3.0)])
    np.testing.assert_allclose(camera.project(points_mm), pixels, atol=1e-3)


def test_defocus_softens_edges_away_from_z_0() -> None:
    contrast = [
        np.abs(np.diff(render_target(CAMERAS["view2"], BOARD, z_mm, OPTICS["view2"])[600])).max() for z_mm in (0, 4.5)
    ]
    assert contrast[1] < 0.8 * contrast[0]
