"""Targets are found to a few hundredths of a pixel in rendered images, and honestly not found otherwise."""

import re

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from processing.calibration.errors import TargetNotFound
from processing.calibration.target.targets import Target, TargetPoints, detect_target
from processing.geometry import FloatArray, PinholeCamera, view_camera
from processing.synthetic.paper_rig import paper_cameras, paper_optics
from processing.synthetic.target import Checkerboard, DotTarget, render_target
from processing.synthetic.target import Target as Pattern

BOARD = Target(kind="checkerboard", columns=23, rows=17, pitch_mm=1.0)
DOTS = Target(kind="dots", columns=23, rows=17, pitch_mm=1.0)
PATTERNS: dict[str, Pattern] = {"checkerboard": Checkerboard(), "dots": DotTarget()}


def photograph(
    view: str,
    target: Target,
    z_mm: float,
    *,
    binning: int = 2,
    blur_px: float = 0.0,
    noise: float = 0.004,
    dust: int = 0,
    seed: int = 1,
) -> tuple[NDArray[np.uint16], PinholeCamera]:
    """12 bit image of a target: uneven light, noise, blur, dust; and the camera that sees it."""
    rng = np.random.default_rng(seed)
    camera = paper_cameras(binning)[view]
    clear = render_target(camera, PATTERNS[target.kind], z_mm, paper_optics(binning)[view])
    if blur_px:
        clear = np.asarray(cv2.GaussianBlur(clear, (0, 0), blur_px), dtype=np.float32)
    rows, columns = clear.shape
    for _ in range(dust):
        place = rng.uniform([0, 0], [columns, rows]).astype(int).tolist()
        cv2.circle(clear, (place[0], place[1]), int(rng.integers(1, 6)), float(rng.uniform(0, 0.5)), -1)
    y, x = np.mgrid[-1 : 1 : rows * 1j, -1 : 1 : columns * 1j]
    light = (1 - 0.3 * (x * x + y * y) + 0.15 * x) * clear
    return np.clip(rng.normal(3000 * light + 100, 4095 * noise), 0, 4095).astype(np.uint16), camera


def errors_px(points: TargetPoints, camera: PinholeCamera, target: Target, z_mm: float) -> FloatArray:
    world_mm = np.column_stack([target.points_mm(points.ids), np.full(len(points), z_mm)])
    return np.asarray(np.linalg.norm(points.image_px - camera.project(world_mm), axis=1), dtype=np.float64)


@pytest.mark.parametrize("view", ["view1", "view3"])
@pytest.mark.parametrize("z_mm", [-4.5, 3.0])
@pytest.mark.parametrize("target", [BOARD, DOTS], ids=lambda target: target.kind)
def test_points_are_accurate_in_oblique_views_and_uneven_light(view: str, z_mm: float, target: Target) -> None:
    image, camera = photograph(view, target, z_mm)
    points = detect_target(image, target)
    assert len(points) == 23 * 17
    assert np.sqrt((errors_px(points, camera, target, z_mm) ** 2).mean()) < 0.03


def test_full_size_board_is_accurate() -> None:
    image, camera = photograph("view1", BOARD, 2.0, binning=1)
    points = detect_target(image, BOARD)
    assert len(points) == 23 * 17
    assert np.sqrt((errors_px(points, camera, BOARD, 2.0) ** 2).mean()) < 0.03


@pytest.mark.parametrize("dark_level", [0.0, 20.0])
@pytest.mark.parametrize("slope_per_px", [(2e-3, 0.0), (0.0, -2e-3), (1e-3, 1e-3), (1e-3, -1e-3)])
@pytest.mark.parametrize("target", [BOARD, DOTS], ids=lambda target: target.kind)
def test_light_that_slopes_moves_no_point(target: Target, slope_per_px: tuple[float, float], dark_level: float) -> None:
    clear = 1000 * render_target(paper_cameras(2)["view3"], PATTERNS[target.kind], -2.0, paper_optics(2)["view3"])
    v, u = np.indices(clear.shape)
    light = np.exp((u - u.mean()) * slope_per_px[0] + (v - v.mean()) * slope_per_px[1])
    even, sloping = detect_target(clear, target), detect_target(clear * light + dark_level, target)
    np.testing.assert_array_equal(sloping.ids, even.ids)
    moved_px = sloping.image_px - even.image_px
    np.testing.assert_allclose(np.median(moved_px, axis=0), 0, atol=0.001)
    np.testing.assert_allclose(moved_px, 0, atol=0.004)


@pytest.mark.parametrize("bright", [False, True])
def test_dots_at_the_edge_of_the_target_are_seen_where_they_are(bright: bool) -> None:
    camera = paper_cameras(2)["view3"]
    clear = 1000 * render_target(camera, DotTarget(), -2.0, paper_optics(2)["view3"])
    points = detect_target(1000 - clear if bright else clear, DOTS)
    true_px = camera.project(np.column_stack([DOTS.points_mm(points.ids), np.full(len(points), -2.0)]))
    for axis, outermost in ((0, 11), (1, 8)):
        outwards = np.sign(points.ids[:, axis]) * (points.image_px - true_px)[:, axis]
        assert abs(outwards[abs(points.ids[:, axis]) == outermost].mean()) < 0.005


@pytest.mark.parametrize("seed", range(6))
def test_blur_noise_and_dust_cost_points_not_accuracy(seed: int) -> None:
    image, camera = photograph("view4", BOARD, -3.0, blur_px=1.5, noise=0.01, dust=40, seed=seed)
    points = detect_target(image, BOARD)
    error_px = errors_px(points, camera, BOARD, -3.0)
    assert len(points) > 0.9 * 23 * 17
    assert np.median(error_px) < 0.05
    assert error_px.max() < 1.0


def test_brightness_and_bit_depth_do_not_matter() -> None:
    image, _ = photograph("view2", BOARD, 0.0)
    points = detect_target(image, BOARD)
    darker = detect_target((image / 4095 * 120).astype(np.uint8), BOARD)
    np.testing.assert_array_equal(darker.ids, points.ids)
    np.testing.assert_allclose(darker.image_px, points.image_px, atol=0.1)


@pytest.mark.parametrize("target", [BOARD, DOTS], ids=lambda target: target.kind)
def test_partly_visible_target_needs_to_be_told_its_origin(target: Target) -> None:
    image, camera = photograph("view2", target, 0.0)
    cut_px = 320
    with pytest.raises(TargetNotFound, match=r"not the whole board of 23 x 17.*origin_px"):
        detect_target(image[:, cut_px:], target)
    u, v = camera.project(np.zeros((1, 3)))[0]
    points = detect_target(image[:, cut_px:], target, origin_px=(u - cut_px + 4, v - 5))
    points.image_px[:, 0] += cut_px
    assert 9 * 17 < len(points) < 23 * 17
    assert errors_px(points, camera, target, 0.0).max() < 0.2


def test_origin_far_from_every_point_is_refused() -> None:
    image, _ = photograph("view2", DOTS, 0.0)
    with pytest.raises(TargetNotFound, match="more than one step"):
        detect_target(image, DOTS, origin_px=(-300.0, 10.0))


def bright_dots(marked: tuple[int, int] | None, size: int = 400, pitch_px: float = 41.3) -> NDArray[np.float32]:
    """Bright specks on black, larger than the image; a thin square around one of them."""
    image = np.zeros((size, size), np.float32)
    v, u = np.mgrid[:size, :size]
    for row in range(10):
        for column in range(10):
            image += np.exp(-((u - 11.3 - pitch_px * column) ** 2 + (v - 9.6 - pitch_px * row) ** 2) / 1.8)
    if marked is not None:
        u0, v0 = (round(edge + pitch_px * step) for edge, step in zip((11.3, 9.6), marked, strict=True))
        cv2.rectangle(image, (u0 - 8, v0 - 8), (u0 + 8, v0 + 8), 0.04, 1)
    return image * 2000


def test_marked_dot_is_the_origin_whatever_the_hint_says() -> None:
    points = detect_target(bright_dots((4, 6)), Target(kind="dots", pitch_mm=3.0), origin_px=(20.0, 20.0))
    origin_px = points.image_px[(points.ids == 0).all(axis=1)]
    np.testing.assert_allclose(origin_px, [[11.3 + 4 * 41.3, 9.6 + 6 * 41.3]], atol=0.03)


@pytest.mark.parametrize("azimuth_deg", [-40.0, -30.0, 0.0, 30.0])
def test_a_ring_marks_the_dot_that_it_surrounds(azimuth_deg: float) -> None:
    """Dots of 0.4 mm at a pitch of 1 mm, a thin ring of 0.28 to 0.36 mm radius: drawn finely, then seen coarsely."""
    camera = view_camera(
        azimuth_deg, focal_length_mm=50.0, magnification=1.0, scale_px_per_mm=25.0, image_size_px=(400, 300)
    )
    v, u = np.indices((1200, 1600)) / 4 - 0.375
    x, y, _ = camera.back_project(np.column_stack([u.ravel(), v.ravel()]), 0.0).T.reshape(3, *u.shape)
    radius = np.hypot(x - np.clip(np.round(x), -5, 5), y - np.clip(np.round(y), -4, 4))
    bright = (radius < 0.2) | ((radius > 0.28) & (radius < 0.36) & (np.round(x) == 2) & (np.round(y) == -1))
    fine = cv2.GaussianBlur(bright.astype(np.float32), (0, 0), 3.0)
    image = cv2.resize(fine, (400, 300), interpolation=cv2.INTER_AREA)
    points = detect_target(20 + 200 * image, Target(kind="dots", pitch_mm=1.0))
    assert len(points) == 11 * 9
    true_px = camera.project(np.column_stack([points.ids + (2, -1), np.zeros(len(points))]))
    np.testing.assert_allclose(points.image_px, true_px, atol=0.1)


@pytest.mark.parametrize(("square_px", "blur_px"), [(100.0, 12.0), (60.0, 9.0)])
def test_a_large_board_may_be_blurred_as_much_as_a_small_one(square_px: float, blur_px: float) -> None:
    v, u = np.mgrid[: int(8 * square_px), : int(10 * square_px)]
    turned = np.deg2rad(4.0)
    x = (np.cos(turned) * (u - u.mean()) + np.sin(turned) * (v - v.mean())) / square_px
    y = (np.cos(turned) * (v - v.mean()) - np.sin(turned) * (u - u.mean())) / square_px
    within = (np.abs(x) < 4) & (np.abs(y) < 3)
    board = np.where(within, (np.floor(x) + np.floor(y)) % 2, 0.5).astype(np.float32)
    image = 20 + 200 * cv2.GaussianBlur(board, (0, 0), blur_px)
    points = detect_target(image, Target(kind="checkerboard", columns=7, rows=5, pitch_mm=1.0))
    x_px = u.mean() + square_px * (np.cos(turned) * points.ids[:, 0] - np.sin(turned) * points.ids[:, 1])
    y_px = v.mean() + square_px * (np.sin(turned) * points.ids[:, 0] + np.cos(turned) * points.ids[:, 1])
    assert len(points) == 35
    np.testing.assert_allclose(points.image_px, np.column_stack([x_px, y_px]), atol=0.2)


def test_dots_without_marker_or_hint_are_refused() -> None:
    with pytest.raises(TargetNotFound, match="origin_px"):
        detect_target(bright_dots(None), Target(kind="dots", pitch_mm=3.0))


@pytest.mark.parametrize("target", [BOARD, DOTS], ids=lambda target: target.kind)
@pytest.mark.parametrize("noise", [0.0, 50.0])
def test_image_without_target_is_refused(target: Target, noise: float) -> None:
    image = np.random.default_rng(3).normal(1000, noise, (150, 200)) if noise else np.full((150, 200), 1000.0)
    with pytest.raises(TargetNotFound):
        detect_target(image, target)


@pytest.mark.parametrize(
    ("size", "advice"),
    [
        ((24, 17), "say where its origin is seen"),
        ((22, 17), "it is larger: are columns and rows right?"),
        ((23, 16), "it is larger: are columns and rows right?"),
        ((24, 18), "columns and rows count inner corners, not squares; or say where"),
        ((25, 19), "say where its origin is seen"),
        ((30, 20), "say where its origin is seen"),
    ],
)
def test_another_board_is_refused(size: tuple[int, int], advice: str) -> None:
    image, _ = photograph("view3", BOARD, 0.0)
    with pytest.raises(TargetNotFound, match=re.escape(f"not the whole board of {size[0]} x {size[1]}; {advice}")):
        detect_target(image, Target(kind="checkerboard", columns=size[0], rows=size[1], pitch_mm=1.0))


@pytest.mark.parametrize(("columns", "rows"), [(23, 17), (7, 6)])
def test_boards_count_from_their_middle(columns: int, rows: int) -> None:
    ids = Target(kind="dots", columns=columns, rows=rows, pitch_mm=2.0).board_ids()
    assert len(np.unique(ids, axis=0)) == columns * rows
    np.testing.assert_array_equal(np.abs(ids.min(axis=0)), [(columns - 1) // 2, (rows - 1) // 2])
    np.testing.assert_array_equal(ids[1] - ids[0], [1, 0])
    assert not len(Target(kind="dots", pitch_mm=2.0).board_ids())


@pytest.mark.parametrize(
    "wrong",
    [
        {"kind": "checkerboard", "pitch_mm": 1.0},
        {"kind": "dots", "columns": 3, "pitch_mm": 1.0},
        {"kind": "dots", "pitch_mm": 0.0},
        {"kind": "rings", "pitch_mm": 1.0},
    ],
)
def test_impossible_targets_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        Target.model_validate(wrong)
