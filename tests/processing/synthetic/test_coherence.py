"""Partially coherent light: sizes as Abbe's sum gives them, and what becomes of discs that are not alone."""

from dataclasses import replace

import numpy as np
import pytest

from processing.coherent_light import CORE_SIGMA, disc_image
from processing.synthetic.coherence import coherent_profiles, with_coherence
from processing.synthetic.paper_rig import paper_cameras, paper_optics
from processing.synthetic.rendering import image_scale_px_per_mm, render_transmittance
from processing.synthetic.spray import Spray
from processing.synthetic.stamping import Discs, FloatArray
from processing.synthetic.union import blurred_union
from tests.support.abbe import PER_AIRY, SIZE, abbe

AIRY_UM = 65.0
CAMERA, OPTICS = paper_cameras()["view2"], replace(paper_optics()["view2"], condenser_ratio=0.2)


def looks_um(distances_um: FloatArray, shadow: FloatArray, area_um2: FloatArray | float, diameter_um: float) -> float:
    """Diameter of the opaque disc that takes as much light, summed to 2.5 Airy disks beyond the edge."""
    near = distances_um < 0.5 * diameter_um + 2.5 * AIRY_UM
    return float(2 * np.sqrt(np.sum((shadow * area_um2)[near]) / np.pi))


@pytest.mark.parametrize(("diameter_um", "ratio"), [(10, 1.40), (20, 1.32), (40, 1.14), (80, 1.07), (160, 1.03)])
def test_small_droplets_look_larger(diameter_um: float, ratio: float) -> None:
    distances, light = coherent_profiles(0.2).of(np.array([diameter_um / AIRY_UM]), np.zeros(1))
    distances_um, step_um = AIRY_UM * distances[0], AIRY_UM * (distances[0, 1] - distances[0, 0])
    seen_um = looks_um(distances_um, 1 - light[0], 2 * np.pi * distances_um * step_um, diameter_um)
    assert seen_um / diameter_um == pytest.approx(ratio, abs=0.015)


@pytest.mark.parametrize(("diameter_um", "ratio"), [(10, 1.40), (20, 1.32), (40, 1.15), (160, 1.03)])
def test_rendered_droplets_look_as_much_larger(diameter_um: float, ratio: float) -> None:
    place = np.array([[0.3, -0.2, 0.0]])
    light = render_transmittance(CAMERA, Spray.of_droplets(place, np.array([diameter_um / 1000])), OPTICS)
    um_per_px = 1000 / image_scale_px_per_mm(CAMERA, place)[0]
    (u, v), (rows, columns) = CAMERA.project(place)[0], np.indices(light.shape)
    distances_um = um_per_px * np.hypot(rows - v, columns - u)
    seen_um = looks_um(distances_um, 1 - light.astype(float), um_per_px**2, diameter_um)
    assert seen_um / diameter_um == pytest.approx(ratio, abs=0.03)


@pytest.mark.parametrize(("diameter", "ratio"), [(0.8, 0.5), (0.3, 0.2)])
def test_abbes_sum_over_many_points_of_the_source(diameter: float, ratio: float) -> None:
    distances, light = coherent_profiles(ratio).of(np.array([diameter]), np.zeros(1))
    x = (np.arange(SIZE) - SIZE // 2) / PER_AIRY
    radii = np.hypot(x[:, None], x)
    near = radii < 2
    expected = abbe([(0.0, 0.0, 0.5 * diameter)], ratio)[near]
    np.testing.assert_allclose(np.interp(radii[near], distances[0], light[0]), expected, atol=4e-3)


@pytest.mark.parametrize(("gap_airy", "rms"), [(-0.3, 0.016), (0.1, 0.008), (0.5, 0.004)])
def test_two_discs_against_abbes_sum_over_their_union(gap_airy: float, rms: float) -> None:
    """Two of 40 um: what overlaps is off by 0.1 at most, where incoherent light is off by 0.37."""
    radius, half = 20 / AIRY_UM, 20 / AIRY_UM + 0.5 * gap_airy
    pair = [(0.0, -half, radius), (0.0, half, radius)]
    centres = SIZE // 2 + PER_AIRY * np.array(pair)[:, :2]
    drawn = Discs(centres, np.full(2, PER_AIRY * radius), np.full(2, 12**-0.5), np.ones(2), np.zeros((2, 2)))
    incoherent = blurred_union(drawn, CORE_SIGMA * PER_AIRY, (SIZE, SIZE))
    error = (with_coherence(incoherent, drawn, PER_AIRY, 0.2) - abbe(pair, 0.2))[48:-48, 48:-48]
    assert np.sqrt(np.mean(error**2)) < rms
    assert np.abs(error).max() < 0.11


def test_light_from_all_over_the_lens_still_has_a_memory() -> None:
    """Abbe's sum is incoherent only for a condenser much wider than the lens: D of 20 um looks larger with 1.0, too."""
    image = disc_image(20 / AIRY_UM, 1.0)
    assert 2 * np.sqrt((1 - image).sum() / 36 / np.pi) * AIRY_UM / 20 > 1.2


def alone_and_together(second_row: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Light past a large disc, past it and a small one, both partially coherent, and past the small one."""
    centres, still = np.array([[40.0, 40.0], [second_row, 40.0]]), np.zeros((2, 2))
    together = Discs(centres, np.array([8.0, 1.5]), np.full(2, 0.3), np.ones(2), still)
    images = [
        with_coherence(blurred_union(some, 0.65, (90, 80)), some, 0.65 * 2.44 / 0.42, 0.2).astype(float)
        for some in (together.select(np.array([0])), together, together.select(np.array([1])))
    ]
    return images[0], images[1], images[2]


def test_a_disc_behind_a_larger_one_adds_nothing() -> None:
    large, both, _ = alone_and_together(43.0)
    np.testing.assert_allclose(both, large, atol=2e-3)


def test_discs_that_do_not_touch_keep_their_own_profiles() -> None:
    large, both, small = alone_and_together(66.0)
    np.testing.assert_allclose(both, large * small, atol=0.02)
    assert np.abs(small - 1).max() > 0.5


def test_coherence_is_asked_for() -> None:
    spray = Spray.of_droplets(np.zeros((1, 3)), np.array([0.02]))
    plain, coherent = (render_transmittance(CAMERA, spray, optics) for optics in (paper_optics()["view2"], OPTICS))
    assert 1.5 < (1 - coherent).sum(dtype=float) / (1 - plain).sum(dtype=float) < 1.9


def test_a_condenser_as_wide_as_all_directions_is_the_widest() -> None:
    with pytest.raises(ValueError, match=r"condenser ratio .* 9"):
        coherent_profiles(9.0)
