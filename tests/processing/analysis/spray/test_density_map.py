"""The map of number density, against counting."""

import numpy as np
import pytest

from processing.analysis.spray.density_map import density_map
from processing.analysis.spray.spray_sample import spray_sample
from processing.volume import VoxelGrid
from tests.support.sampled_sprays import BOX, stored_shot


def test_the_map_holds_every_droplet_and_shots_of_chance_scatter_as_chance_says() -> None:
    rng = np.random.default_rng(0)
    low_mm, high_mm = np.array([-5, 8, -5]), np.array([5, 12, 5])
    shots = [
        stored_shot(np.full(count, 30.0), rng.uniform(low_mm, high_mm, (count, 3)), shot=shot)
        for shot, count in enumerate(rng.poisson(960, 40))
    ]
    sample = spray_sample(shots)
    found = density_map(sample, "x", "z")
    assert found
    assert found.mean_per_mm3.shape == (24, 24)
    assert found.mean_per_mm3.mean() == pytest.approx(len(sample) / (40 * 400))
    assert found.rms_per_mm3.mean() == pytest.approx(found.chance_per_mm3.mean(), rel=0.05)
    assert (found.across_mm[0], found.across_mm[-1]) == pytest.approx((-5, 5))
    side = density_map(sample, "x", "y")
    assert side
    assert side.mean_per_mm3.shape == (10, 24)


def test_a_droplet_is_drawn_where_it_is() -> None:
    found = density_map(spray_sample([stored_shot(np.array([30.0]), np.array([[-4.9, 11.9, 0.0]]))]), "x", "y")
    assert found
    assert np.argwhere(found.mean_per_mm3).tolist() == [[9, 0]]
    assert np.isnan(found.rms_per_mm3).all()


def test_shots_of_two_boxes_have_no_map() -> None:
    small = VoxelGrid((10, 10, 10), (0, 8, 0), 0.1)
    shots = [stored_shot(np.full(3, 30.0), grid=grid, shot=shot) for shot, grid in enumerate((BOX, small))]
    assert density_map(spray_sample(shots)) is None
