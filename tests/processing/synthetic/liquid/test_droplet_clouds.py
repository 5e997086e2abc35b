"""Clouds of droplets: sizes as their distributions say, anywhere in the box, flying as they are told."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from processing.synthetic.liquid.droplet_clouds import Box, Flow, LogNormal, RosinRammler, droplet_cloud
from processing.volume import VoxelGrid

GRID = VoxelGrid.centred((50, 60, 70), 1 / 60)


def test_lognormal_has_its_median_its_spread_and_its_least() -> None:
    diameters_mm = LogNormal(0.04, 0.4, 0.02).diameters_mm(100_000, np.random.default_rng(0))
    assert np.median(diameters_mm) == pytest.approx(0.04, rel=0.01)
    quarter, three_quarters = np.quantile(np.log(diameters_mm), [0.25, 0.75])
    assert (three_quarters - quarter) / 1.349 == pytest.approx(0.4, rel=0.02)
    assert diameters_mm.min() == 0.02


@given(st.floats(0.05, 0.2), st.floats(1.5, 4), st.floats(0.01, 0.04))
@settings(max_examples=12, deadline=None)
def test_rosin_rammler_shares_out_the_volume(size_mm: float, exponent: float, least_mm: float) -> None:
    diameters_mm = RosinRammler(size_mm, exponent, least_mm).diameters_mm(150_000, np.random.default_rng(1))
    assert diameters_mm.min() >= least_mm
    weights = diameters_mm**3 / np.sum(diameters_mm**3)
    left_out = np.exp(-((least_mm / size_mm) ** exponent))
    for relative in (0.7, 1.0, 1.4):
        share = weights[diameters_mm > relative * size_mm].sum()
        assert share == pytest.approx(np.exp(-(relative**exponent)) / left_out, abs=0.04)


def test_rosin_rammler_without_a_least_diameter_is_refused() -> None:
    with pytest.raises(ValueError, match="least diameter"):
        RosinRammler(least_mm=0.0).diameters_mm(1, np.random.default_rng(0))


def test_a_box_is_the_voxels_and_a_margin() -> None:
    box = Box.around(GRID, margin_mm=0.25)
    np.testing.assert_allclose(np.subtract(box.upper_mm, box.lower_mm), np.array([70, 60, 50]) / 60 + 0.5)
    np.testing.assert_allclose(np.add(box.upper_mm, box.lower_mm), 0, atol=1e-12)


def test_a_cloud_is_as_dense_within_a_grid_as_around_it() -> None:
    box = Box.around(GRID, margin_mm=0.3)
    cloud = droplet_cloud(box, 5000.0, LogNormal(), np.random.default_rng(2))
    assert len(cloud) == round(5000 * box.volume_mm3)
    inside = len(cloud.inside(GRID))
    expected = 5000 * Box.around(GRID).volume_mm3
    assert inside == pytest.approx(expected, abs=4 * np.sqrt(expected))


def test_droplets_fly_as_the_flow_says() -> None:
    flow = Flow((1e3, 2e4, 0.0), ((0.0, 0.0, 0.0), (0.0, 0.0, 500.0), (0.0, 0.0, 0.0)), 300.0)
    cloud = droplet_cloud(Box((-2, -2, -2), (2, 2, 2)), 200.0, LogNormal(), np.random.default_rng(3), flow)
    slope, at_origin = np.polyfit(cloud.positions_mm[:, 2], cloud.velocities_mm_per_s[:, 1], 1)
    assert slope == pytest.approx(500, abs=20)
    assert at_origin == pytest.approx(2e4, abs=20)
    np.testing.assert_allclose(cloud.velocities_mm_per_s[:, 0].mean(), 1e3, atol=20)
    np.testing.assert_allclose(cloud.velocities_mm_per_s[:, [0, 2]].std(axis=0), 300, rtol=0.05)


def test_equal_seeds_give_equal_clouds() -> None:
    first, second = (droplet_cloud(Box.around(GRID), 50.0, LogNormal(), np.random.default_rng(4)) for _ in range(2))
    np.testing.assert_array_equal(first.positions_mm, second.positions_mm)
    np.testing.assert_array_equal(first.diameters_mm, second.diameters_mm)
