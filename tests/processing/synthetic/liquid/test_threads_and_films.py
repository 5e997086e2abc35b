"""Threads and films: smooth, of their length, size and opacity, and flying as a whole."""

import numpy as np
import pytest

from processing.synthetic.liquid.droplet_clouds import Box, Flow
from processing.synthetic.liquid.threads_and_films import films, thread, threads
from processing.synthetic.paper_rig import paper_cameras, paper_optics
from processing.synthetic.rendering import render_transmittance
from processing.synthetic.spray import LiquidKind

BOX = Box((-2.0, -2.0, -1.0), (2.0, 2.0, 1.0))


def test_a_thread_is_a_curved_tube_of_its_length() -> None:
    centres_mm = thread(np.array([1.0, 2.0, 3.0]), 1.2, 0.06, np.random.default_rng(0))
    steps_mm = np.linalg.norm(np.diff(centres_mm, axis=0), axis=1)
    np.testing.assert_array_equal(centres_mm[0], [1.0, 2.0, 3.0])
    np.testing.assert_allclose(steps_mm, 0.35 * 0.06)
    assert steps_mm.sum() == pytest.approx(1.2, abs=0.02)
    assert 0.5 < np.linalg.norm(centres_mm[-1] - centres_mm[0]) < 1.19


def test_a_straight_thread_is_a_ray() -> None:
    centres_mm = thread(np.zeros(3), 1.0, 0.05, np.random.default_rng(0), turn_rad=0.0)
    assert np.linalg.matrix_rank(centres_mm[1:], tol=1e-9) == 1


def test_threads_fly_as_wholes_and_are_opaque() -> None:
    some = threads(BOX, 5, np.random.default_rng(1), Flow((0.0, 1e4, 0.0), scatter_mm_per_s=500.0))
    assert len(np.unique(some.velocities_mm_per_s, axis=0)) == 5
    assert set(some.kinds) == {LiquidKind.LIGAMENT}
    assert set(some.opacities) == {1.0}
    assert len(threads(BOX, 0, np.random.default_rng(1))) == 0


@pytest.mark.parametrize("seed", range(4))
def test_a_film_is_flat_and_darkens_with_the_path_of_light_through_it(seed: int) -> None:
    camera, optics = paper_cameras()["view2"], paper_optics()["view2"]
    film = films(Box((0, 0, 0), (0, 0, 0)), 1, np.random.default_rng(seed), radii_mm=(1.0, 1.0))
    assert set(film.kinds) == {LiquidKind.SHEET}
    assert np.linalg.norm(film.positions_mm, axis=1).max() == pytest.approx(1.0, abs=0.1)
    normal = np.linalg.svd(film.positions_mm)[2][2]
    np.testing.assert_allclose(film.positions_mm @ normal, 0, atol=1e-9)
    facing = abs(camera.ray_directions(np.zeros((1, 3)))[0] @ normal)
    light = render_transmittance(camera, film, optics)
    u, v = np.rint(camera.project(np.zeros((1, 3)))[0]).astype(int)
    balls_per_mm2, ball_mm2 = 1 / 0.08**2, np.pi / 4 * 0.2**2
    face_on = balls_per_mm2 * ball_mm2 * np.log(1 - 0.08)
    assert np.log(light[v - 5 : v + 6, u - 5 : u + 6].mean()) == pytest.approx(face_on / facing, rel=0.1)
