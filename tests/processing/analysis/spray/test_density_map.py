"""The map of number density, against counting."""

import json
from dataclasses import replace

import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.spray.density_map import FEW, NO_CELLS, ToldDensity, density_map
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


CORE_MM = 25 / 12
"""Half of the width of a dark core along y, five cells."""


def dark_core(scale: float = 1.0, seed: int = 1) -> list[StoredDroplets]:
    """An even spray of 25 per mm^3 at scale 1, of which a core hides a third of the depth."""
    grid = VoxelGrid(BOX.shape, (scale * BOX.origin_mm[0], scale * 8.05, scale * BOX.origin_mm[2]), scale * 0.1)
    low_mm, high_mm = scale * np.array([-5, 8, -5]), scale * np.array([5, 12, 5])
    rng, told = np.random.default_rng(seed), []
    x, z = (np.arange(24) + 0.5) / 2.4 - 5, (np.arange(48) + 0.5) / 4.8 - 5
    beside, before = np.abs(x) < CORE_MM, np.abs(z) < 5 / 3
    xz = np.where(beside & before[:, None], 0, 100).reshape(24, 2, 24).mean(axis=1)
    xy = np.tile(np.where(beside, 67, 100), (10, 1))
    percent = {"xy": xy.tolist(), "xz": np.rint(xz).astype(int).tolist()}
    hidden = {"volume_share": 5 / 36, "measured_percent": percent}
    for shot in range(20):
        points_mm = rng.uniform(low_mm, high_mm, (rng.poisson(10_000), 3))
        hides = (np.abs(points_mm[:, 0]) < scale * CORE_MM) & (np.abs(points_mm[:, 2]) < scale * 5 / 3)
        kept = points_mm[~hides]
        exposures = json.dumps({"a": {"verdict": "good", "hidden": hidden}})
        told.append(stored_shot(np.full(len(kept), 30.0), kept, shot=shot, grid=grid, exposures=exposures))
    return told


def test_behind_a_dark_core_the_density_is_as_high_as_beside_it() -> None:
    sample = spray_sample(dark_core())
    found, uneven = density_map(sample), density_map(replace(sample, measured_shares={}))
    assert found
    assert uneven
    behind = np.abs(found.across_mm[:-1] + np.diff(found.across_mm) / 2) < CORE_MM
    scores = (found.mean_per_mm3 - 25) / (found.chance_per_mm3 / np.sqrt(20))
    assert 0.85 < scores.std() < 1.15
    assert abs(scores[:, behind].mean()) < 0.4
    assert uneven.mean_per_mm3[:, behind].mean() == pytest.approx(25 * 2 / 3 / (1 - 5 / 36), rel=0.03)
    assert found.rms_per_mm3[:, behind].mean() == pytest.approx(found.chance_per_mm3[:, behind].mean(), rel=0.1)
    assert found.measured_share is not None
    assert np.unique(found.measured_share).tolist() == pytest.approx([0.67, 1])


def test_where_less_than_half_could_be_measured_there_is_no_density_but_a_reason() -> None:
    found = density_map(spray_sample(dark_core()), "x", "z")
    assert found
    assert found.measured_share is not None
    np.testing.assert_array_equal(np.isnan(found.mean_per_mm3), found.measured_share < 0.5)
    assert np.isnan(found.mean_per_mm3[12, 12])
    assert np.nanmean(found.mean_per_mm3) == pytest.approx(25, rel=0.02)
    told = ToldDensity.of(found)
    assert (told.mean_per_mm3[12][12], told.rms_per_mm3[12][12], told.chance_per_mm3[12][12]) == (None, None, None)
    assert told.reason == FEW


def test_a_box_ten_times_as_large_has_a_thousandth_of_the_density_in_the_same_cells() -> None:
    one, other = (density_map(spray_sample(dark_core(scale))) for scale in (1.0, 10.0))
    assert one
    assert other
    np.testing.assert_allclose(other.mean_per_mm3, one.mean_per_mm3 / 1000)
    np.testing.assert_allclose(other.rms_per_mm3, one.rms_per_mm3 / 1000)
    np.testing.assert_array_equal(other.measured_share, one.measured_share)


def test_both_exposures_of_a_shot_are_of_the_volume_that_each_of_them_saw() -> None:
    """What the files of A and B say is added up; the same droplets twice make no density, and nothing surer."""
    shot = dark_core()[0]
    exposure = json.loads(str(shot.provenance["exposures"]))["a"]
    twice = {name: np.concatenate([column, column]) for name, column in shot.columns.items()}
    both = StoredDroplets(twice, {**shot.provenance, "exposures": json.dumps({"a": exposure, "b": exposure})})
    one, other = (density_map(spray_sample([seen])) for seen in (shot, both))
    assert one
    assert other
    np.testing.assert_allclose(other.mean_per_mm3, one.mean_per_mm3)
    np.testing.assert_allclose(other.chance_per_mm3, one.chance_per_mm3)


@pytest.mark.parametrize("rows", [None, [[100]], [[100] * 24] * 9 + [[100]]])
def test_without_a_map_of_these_cells_what_is_hidden_is_taken_off_everywhere_alike(rows: object) -> None:
    shots = dark_core()[:2]
    exposure = {"verdict": "good", "hidden": {"volume_share": 0.5, "measured_percent": rows and {"xy": rows}}}
    shots[1] = StoredDroplets(shots[1].columns, {**shots[1].provenance, "exposures": json.dumps({"a": exposure})})
    found = density_map(spray_sample(shots))
    assert found
    assert found.measured_share is None
    assert np.isfinite(found.mean_per_mm3).all()
    assert ToldDensity.of(found).reason == NO_CELLS
