"""Shots for studies: what the views see, divided by their light, with the noise of counting."""

import numpy as np
import pytest

from processing.studies.simulated_droplets import study_cameras, study_grid
from processing.synthetic.liquid.droplet_clouds import Box, LogNormal, droplet_cloud
from processing.synthetic.paper_rig import paper_optics
from processing.synthetic.rendering import render_transmittance
from processing.synthetic.shadow_shots import Counting, transmission_images
from processing.synthetic.spray import Spray
from processing.synthetic.union import ACCURATE

CAMERAS, OPTICS = study_cameras((200, 120)), list(paper_optics().values())
NOTHING = Spray.of_droplets(np.empty((0, 3)), np.empty(0))


def test_noise_is_that_of_counted_electrons() -> None:
    counting, rng = Counting(), np.random.default_rng(0)
    for transmittance in (1.0, 0.25, 0.0):
        image = counting.transmission(np.full((300, 300), transmittance, np.float32), rng)
        sd = np.sqrt(7400 * transmittance + 25**2) / 7400
        assert image.mean() == pytest.approx(transmittance, abs=4 * sd / 300)
        assert image.std() == pytest.approx(sd, rel=0.02)
        assert image.dtype == np.float32


def test_noise_may_be_asked_for() -> None:
    image = Counting.of_noise(0.03).transmission(np.ones((300, 300), np.float32), np.random.default_rng(1))
    assert image.std() == pytest.approx(0.03, rel=0.02)


def test_a_background_of_few_frames_adds_its_noise() -> None:
    counting = Counting.of_noise(0.02, background_frames=4)
    image = counting.transmission(np.ones((300, 300), np.float32), np.random.default_rng(2))
    assert image.std() == pytest.approx(0.02 * np.sqrt(1 + 1 / 4), rel=0.02)


def test_views_see_droplets_outside_of_the_grid_too() -> None:
    grid = study_grid((60, 60, 60))
    cloud = droplet_cloud(Box.around(grid, margin_mm=0.4), 20.0, LogNormal(), np.random.default_rng(3))
    assert 0 < len(cloud.inside(grid)) < len(cloud)
    images = transmission_images(CAMERAS, OPTICS, cloud, Counting(), np.random.default_rng(4))
    for image, camera, optics in zip(images, CAMERAS, OPTICS, strict=True):
        difference = image - render_transmittance(camera, cloud, optics, sampling=ACCURATE)
        assert np.abs(difference.mean()) < 4e-4
        assert 0.8 * 0.012 < difference.std() < 1.1 * 0.012


def test_equal_seeds_give_equal_noise_and_views_have_their_own() -> None:
    first, second = (
        transmission_images(CAMERAS, OPTICS, NOTHING, Counting(), np.random.default_rng(5)) for _ in range(2)
    )
    np.testing.assert_array_equal(first, second)
    assert not np.array_equal(first[0], first[1])
