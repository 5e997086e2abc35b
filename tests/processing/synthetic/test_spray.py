"""Spray: flight, selections, and the truth volume."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from processing.synthetic.spray import LiquidKind, Spray, droplet_volume
from processing.volume import VoxelGrid

GRID = VoxelGrid.centred((40, 50, 60), 1 / 60)


def droplets(count: int, seed: int = 0) -> Spray:
    rng = np.random.default_rng(seed)
    return Spray.of_droplets(rng.uniform(-0.2, 0.2, (count, 3)), np.full(count, 0.06), rng.normal(0, 1e4, (count, 3)))


@given(st.floats(-1e-4, 1e-4), st.floats(-1e-4, 1e-4))
def test_flight_adds_up_and_returns(first_s: float, second_s: float) -> None:
    spray = droplets(5)
    there = spray.advanced(first_s).advanced(second_s)
    np.testing.assert_allclose(there.positions_mm, spray.advanced(first_s + second_s).positions_mm, atol=1e-12)
    np.testing.assert_allclose(there.advanced(-first_s - second_s).positions_mm, spray.positions_mm, atol=1e-12)


def test_flight_of_the_papers_pulse_separation() -> None:
    spray = Spray.of_droplets(np.zeros((1, 3)), np.array([0.05]), np.array([[0.0, 25_000.0, 0.0]]))
    np.testing.assert_allclose(spray.advanced(6400e-9).positions_mm, [[0, 0.16, 0]])


def test_joined_parts_come_apart_by_kind() -> None:
    drops = droplets(7)
    threads = Spray(
        drops.positions_mm, drops.diameters_mm, drops.velocities_mm_per_s,
        np.full(7, LiquidKind.LIGAMENT, np.uint8), drops.opacities,
    )  # fmt: skip
    joined = Spray.joined([threads, drops])
    assert len(joined) == 14
    np.testing.assert_array_equal(joined.of_kind(LiquidKind.DROPLET).positions_mm, drops.positions_mm)
    assert len(joined.of_kind(LiquidKind.SHEET)) == 0


def test_inside_counts_whole_voxels() -> None:
    edge_mm = 0.5 * 60 / 60
    positions_mm = np.array([[edge_mm - 1e-6, 0, 0], [edge_mm + 1e-6, 0, 0], [0, 0, 0.4]])
    spray = Spray.of_droplets(positions_mm, np.full(3, 0.05))
    np.testing.assert_array_equal(spray.inside(GRID).positions_mm, positions_mm[:1])


def test_columns_of_unequal_length_are_refused() -> None:
    with pytest.raises(ValueError, match="3 balls"):
        Spray.of_droplets(np.zeros((2, 3)), np.full(3, 0.05))


@given(st.tuples(*[st.floats(-0.15, 0.15)] * 3), st.floats(0.02, 0.12))
@settings(max_examples=25)
def test_droplet_peaks_at_its_voxel_and_keeps_its_centre(
    position: tuple[float, float, float], diameter_mm: float
) -> None:
    spray = Spray.of_droplets(np.array([position]), np.array([diameter_mm]))
    volume = droplet_volume(spray, GRID, sigma_mm=1.2 / 60).astype(float)
    assert volume.shape == GRID.shape
    assert 0 <= volume.min() <= volume.max() <= 1
    expected = GRID.to_index(spray.positions_mm)[0]
    centre = [
        np.average(np.arange(n), weights=volume.sum(axis=tuple({0, 1, 2} - {axis})))
        for axis, n in enumerate(GRID.shape)
    ]
    np.testing.assert_allclose(centre, expected, atol=0.01)
    assert volume[tuple(np.rint(expected).astype(int))] == pytest.approx(volume.max(), abs=1e-3)


def test_overlapping_droplets_stay_below_one_and_add_as_opacities() -> None:
    spray = droplets(2)
    one, two = (droplet_volume(spray.where(np.arange(2) == index), GRID, 1.5 / 60).astype(float) for index in (0, 1))
    np.testing.assert_allclose(droplet_volume(spray, GRID, 1.5 / 60), 1 - (1 - one) * (1 - two), atol=1e-6)


def test_blur_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="sigma_mm must be positive"):
        droplet_volume(droplets(1), GRID, 0.0)
