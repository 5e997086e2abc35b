"""The pinhole camera: eqs. 3 to 5, distortion, tilt, and their inverses."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from processing.geometry import PinholeCamera, rotation_from_angles, rotation_vector_of, view_camera

DISTORTION = np.array([2.0, 50.0, 0.004, -0.003, 0.0])


def camera(azimuth_deg: float = 45.0) -> PinholeCamera:
    return view_camera(azimuth_deg, focal_length_mm=100, magnification=0.45, scale_px_per_mm=60, distortion=DISTORTION)


@given(st.floats(-1.5, 1.5), st.floats(-0.5, 0.5), st.floats(-0.2, 0.2))
def test_rotation_is_a_rotation(yaw: float, pitch: float, roll: float) -> None:
    rotation = rotation_from_angles(yaw, pitch, roll)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_rotation_is_equation_4() -> None:
    phi, psi = 0.3, -0.2
    pitch = np.array([[1, 0, 0], [0, np.cos(psi), np.sin(psi)], [0, -np.sin(psi), np.cos(psi)]])
    yaw = np.array([[np.cos(phi), 0, -np.sin(phi)], [0, 1, 0], [np.sin(phi), 0, np.cos(phi)]])
    np.testing.assert_allclose(rotation_from_angles(phi, psi), pitch @ yaw)


def test_origin_is_seen_at_the_image_centre_at_the_stated_scale() -> None:
    view = view_camera(0.0, focal_length_mm=85, magnification=0.43, scale_px_per_mm=60)
    seen_px = view.project(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]))
    np.testing.assert_allclose(seen_px[0], [799.5, 599.5], atol=1e-9)
    np.testing.assert_allclose(seen_px[1:] - seen_px[0], [[60, 0], [0, 60]], atol=1e-9)


def test_offset_principal_point_still_looks_at_the_origin() -> None:
    view = view_camera(
        15, focal_length_mm=85, magnification=0.43, scale_px_per_mm=60, principal_offset_px=(250.0, -100.0)
    )
    np.testing.assert_allclose(view.project(np.zeros((1, 3)))[0], [799.5, 599.5], atol=1e-9)


@pytest.mark.parametrize("tilt_rad", [(0.0, 0.0), (0.05, -0.08)])
@pytest.mark.parametrize("azimuth_deg", [45.0, 15.0, -15.0, -45.0])
def test_back_projection_inverts_projection(azimuth_deg: float, tilt_rad: tuple[float, float]) -> None:
    base = camera(azimuth_deg)
    view = PinholeCamera(
        base.camera_matrix, base.rotation, base.translation_mm, base.image_size_px, base.distortion, tilt_rad
    )
    points_mm = np.random.default_rng(1).uniform([-8, -8, 0], [8, 8, 0], (50, 3)) + [0, 0, 2.5]
    recovered_mm = view.back_project(view.project(points_mm), z_mm=2.5)
    np.testing.assert_allclose(recovered_mm, points_mm, atol=1e-6)


def test_projection_follows_the_ray() -> None:
    view = camera(-15.0)
    point_mm = np.array([[3.0, -2.0, 1.0]])
    further_mm = view.centre_mm + 1.1 * (point_mm - view.centre_mm)
    np.testing.assert_allclose(view.project(further_mm), view.project(point_mm), atol=1e-8)
    np.testing.assert_allclose(view.ray_directions(further_mm), view.ray_directions(point_mm))


def test_no_points_project_to_no_points() -> None:
    assert camera().project(np.empty((0, 3))).shape == (0, 2)


@given(st.lists(st.floats(-3, 3), min_size=3, max_size=3), st.floats(0, 7))
def test_rotation_vectors_keep_the_smallest_turns(axis: list[float], decades: float) -> None:
    vector = 10**-decades * np.array(axis) / np.linalg.norm([*axis, 1.0])
    rotation = np.asarray(cv2.Rodrigues(vector)[0], dtype=np.float64)
    np.testing.assert_allclose(rotation_vector_of(rotation), vector, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("angle_rad", [0.0, 1e-9, 1.0, 2.09, 2.1, 3.1, 3.14159, np.pi])
def test_rotation_vectors_are_exact_at_any_angle(angle_rad: float) -> None:
    axis = np.array([0.6, -0.64, 0.48])
    rotation = np.asarray(cv2.Rodrigues(angle_rad * axis)[0], dtype=np.float64) if angle_rad > 1e-6 else np.eye(3)
    vector = rotation_vector_of(rotation)
    np.testing.assert_allclose(cv2.Rodrigues(vector)[0], rotation, atol=1e-14)
    assert np.linalg.norm(vector) == pytest.approx(angle_rad if angle_rad > 1e-6 else 0.0, abs=1e-12)


@given(
    st.integers(0, 2**32 - 1),
    st.floats(-1.5, 1.5),
    st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)),
    st.booleans(),
)
def test_projection_is_that_of_opencv(seed: int, yaw_rad: float, tilt_rad: tuple[float, float], tilted: bool) -> None:
    rng = np.random.default_rng(seed)
    view = PinholeCamera(
        camera_matrix=np.array([[rng.uniform(4e3, 3e4), 0, 800], [0, rng.uniform(4e3, 3e4), 600], [0, 0, 1.0]]),
        rotation=rotation_from_angles(yaw_rad, *rng.uniform(-0.5, 0.5, 2)),
        translation_mm=np.array([*rng.uniform(-5, 5, 2), rng.uniform(50, 400)]),
        image_size_px=(1600, 1200),
        distortion=rng.uniform(-1, 1, 5) * [1, 30, 0.01, 0.01, 500],
        tilt_rad=tilt_rad if tilted else (0.0, 0.0),
    )
    points_mm = rng.uniform(-10, 10, (20, 3))
    expected_px, _ = cv2.projectPoints(
        points_mm, cv2.Rodrigues(view.rotation)[0], view.translation_mm, view.camera_matrix, view.coefficients
    )
    np.testing.assert_allclose(view.project(points_mm), expected_px.reshape(-1, 2), rtol=1e-9, atol=1e-6)
