"""Views of a spray: every droplet where the camera sees it, blurred as the optics demand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from processing.synthetic.paper_rig import paper_cameras, paper_optics
from processing.synthetic.rendering import depth_out_of_focus_mm, image_scale_px_per_mm, render_transmittance
from processing.synthetic.spray import Spray
from processing.synthetic.stamping import FloatArray
from processing.synthetic.view_optics import ViewOptics

CAMERAS, OPTICS = paper_cameras(), paper_optics()
VIEWS = st.sampled_from(sorted(CAMERAS))


def shadow_of(view: str, spray: Spray, exposure_s: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Shadow 0..1 around a droplet, and the (row, column) of its pixels, each (2, N)."""
    shadow = 1 - render_transmittance(CAMERAS[view], spray, OPTICS[view], exposure_s)
    pixels = np.array(np.nonzero(shadow))
    return shadow[tuple(pixels)].astype(float), pixels.astype(float)


@given(VIEWS, st.tuples(st.floats(-8, 8), st.floats(-8, 8), st.floats(-4, 4)), st.floats(0.015, 0.2))
@settings(max_examples=25)
def test_centroid_is_the_projection_within_a_hundredth_pixel(
    view: str, position: tuple[float, float, float], diameter_mm: float
) -> None:
    spray = Spray.of_droplets(np.array([position]), np.array([diameter_mm]), np.array([[8e3, 2e4, -5e3]]))
    weights, pixels = shadow_of(view, spray, exposure_s=1e-6)
    seen_px = np.average(pixels[::-1], axis=1, weights=weights)
    np.testing.assert_allclose(seen_px, CAMERAS[view].project(spray.positions_mm)[0], atol=0.01)


@pytest.mark.parametrize("view", sorted(CAMERAS))
def test_shadow_has_the_area_of_the_droplet(view: str) -> None:
    spray = Spray.of_droplets(np.array([[1.0, 2.0, 3.0]]), np.array([0.1]))
    scale = image_scale_px_per_mm(CAMERAS[view], spray.positions_mm)[0]
    weights, _ = shadow_of(view, spray)
    assert weights.sum() == pytest.approx(np.pi / 4 * (0.1 * scale) ** 2, rel=0.01)


@pytest.mark.parametrize("view", sorted(CAMERAS))
def test_a_droplet_behind_a_larger_one_takes_no_light(view: str) -> None:
    """Its middle is seen 0.05 mm beside that of the larger one, a millimetre further away."""
    camera = CAMERAS[view]
    towards_light = camera.ray_directions(np.zeros((1, 3)))[0]
    across = np.array([0.0, 0.05, 0.0])
    larger = Spray.of_droplets(np.zeros((1, 3)), np.array([0.2]))
    both = Spray.of_droplets(np.array([[0.0, 0.0, 0.0], towards_light + across]), np.array([0.2, 0.06]))
    alone_light, both_light = (render_transmittance(camera, spray, OPTICS[view]) for spray in (larger, both))
    np.testing.assert_allclose(both_light, alone_light, atol=2e-3)


def variance_px2(view: str, z_mm: float) -> float:
    spray = Spray.of_droplets(np.array([[0.0, 0.0, z_mm]]), np.array([0.02]))
    weights, pixels = shadow_of(view, spray)
    return float(np.average((pixels[0] - np.average(pixels[0], weights=weights)) ** 2, weights=weights))


def test_blur_in_focus_is_that_of_diffraction_and_grows_with_depth() -> None:
    droplet_px2 = (0.5 * 0.02 * 60) ** 2 / 4
    in_focus = variance_px2("view1", 0.0) - droplet_px2
    # The 42 % rule: sigma of the Airy core is 0.42 lambda f# (M + 1); 1 / 12 px^2 is the pixel.
    assert in_focus == pytest.approx((0.42 * 0.5 * 22 * 1.45 / 7.4) ** 2 + 1 / 12, rel=0.05)
    assert variance_px2("view1", 4.0) > variance_px2("view1", 2.0) > variance_px2("view1", 0.0)
    assert variance_px2("view1", -4.0) == pytest.approx(variance_px2("view1", 4.0), rel=0.1)


def test_motion_lengthens_along_the_flight_only() -> None:
    spray = Spray.of_droplets(np.zeros((1, 3)), np.array([0.05]), np.array([[0.0, 40_000.0, 0.0]]))
    (still, pixels), (moving, _) = shadow_of("view2", spray), shadow_of("view2", spray, exposure_s=1e-6)
    spread = [
        np.average((axis - 0.5 * (size - 1)) ** 2, weights=weights)
        for weights, points in ((still, pixels), shadow_of("view2", spray, exposure_s=1e-6))
        for axis, size in zip(points, (1200, 1600), strict=True)
    ]
    assert moving.sum() == pytest.approx(still.sum(), rel=1e-3)
    assert spread[2] - spread[0] == pytest.approx((0.04 * 60) ** 2 / 12, rel=0.05)
    assert spread[3] == pytest.approx(spread[1], rel=0.01)


def test_optics_of_table_1() -> None:
    airy_um = [optics.diffraction_sigma_px * 7.4 * 2.44 / 0.42 for optics in OPTICS.values()]
    np.testing.assert_allclose(airy_um, [39, 28, 28, 38], atol=0.6)


def test_defocus_is_that_of_the_thin_lens() -> None:
    optics = ViewOptics(16, 85, 0.43, 7.4, 10)
    lens_mm, object_mm = 85 / 16, 85 * (1 + 1 / 0.43)
    circle_px = 4.0 * lens_mm / object_mm * 0.43 * 1000 / 7.4
    sigma_px = optics.optical_sigma_px(np.array([4.0]))[0]
    assert sigma_px**2 - optics.diffraction_sigma_px**2 == pytest.approx((circle_px / 4) ** 2)


def test_plane_z_0_is_in_focus_everywhere() -> None:
    points_mm = np.array([[-9.0, 8.0, 0.0], [9.0, -8.0, 0.0], [0.0, 0.0, 3.0]])
    for view, azimuth_deg in (("view1", 45), ("view3", -15)):
        depth_mm = depth_out_of_focus_mm(CAMERAS[view], points_mm)
        np.testing.assert_allclose(depth_mm[:2], 0, atol=1e-12)
        assert depth_mm[2] == pytest.approx(3 / np.cos(np.radians(azimuth_deg)), rel=0.02)


def test_distortion_moves_the_worst_corner_by_1_5_to_3_px() -> None:
    for camera in CAMERAS.values():
        width_px, height_px = camera.image_size_px
        corners_px = np.array([[0, 0], [width_px - 1, 0], [0, height_px - 1], [width_px - 1, height_px - 1.0]])
        assert 1.5 < np.linalg.norm(camera.undistort(corners_px) - corners_px, axis=1).max() < 3.0


def test_binned_cameras_see_the_same_at_a_smaller_scale() -> None:
    points_mm = np.random.default_rng(0).uniform(-4, 4, (20, 3))
    for view, binned in paper_cameras(binning=4).items():
        assert binned.image_size_px == (400, 300)
        centre_px, binned_centre_px = np.array([799.5, 599.5]), np.array([199.5, 149.5])
        np.testing.assert_allclose(
            (CAMERAS[view].project(points_mm) - centre_px) / 4, binned.project(points_mm) - binned_centre_px, atol=1e-6
        )
    assert paper_optics(binning=4)["view1"].diffraction_sigma_px == pytest.approx(
        OPTICS["view1"].diffraction_sigma_px / 4
    )
