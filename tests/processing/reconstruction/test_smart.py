"""SMART and MART: equal to the textbook, and better than a line of sight."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.analysis.quality import quality_factor
from processing.geometry import ViewMapping, view_camera
from processing.kernels import _native
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.planning.node_view import sample_mapping
from processing.reconstruction.planning.plan import Plan, plan_reconstruction
from processing.reconstruction.smart import mart, smart
from processing.volume import VoxelGrid
from tests.support import oracle
from tests.support.sight_cases import Images, instruction_set, random_plan

GRID = VoxelGrid.centred((17, 43, 261), 1 / 60)
SMART_FROM_START, SMART_FROM_MLOS, MART = (1.5e-3, 1e-2), (3e-3, 2e-2), (1.5e-2, 0.1)
"""What ``smart`` and ``mart`` state after three iterations: of the norm of the volume, and of its brightest voxel."""


def make_plan(mappings: list[ViewMapping], by_nodes: bool, grid: VoxelGrid = GRID) -> Plan:
    if by_nodes:
        return Plan(grid, tuple(sample_mapping(mapping, grid, 0.02) for mapping in mappings))
    return plan_reconstruction(mappings, grid)


def droplets(count: int, seed: int = 5) -> NDArray[np.float64]:
    """Positions as voxel indices (z, y, x), clear of the faces."""
    return np.random.default_rng(seed).uniform(4, np.array(GRID.shape) - 5, (count, 3))


def images_of(
    positions: NDArray[np.float64], mappings: list[ViewMapping], sigma_px: float = 1.5, grid: VoxelGrid = GRID
) -> Images:
    images = []
    for mapping in mappings:
        width, height = mapping.image_size_px
        image = np.zeros((height, width))
        for u, v in mapping.project(grid.to_mm(positions)):
            along_u = np.exp(-((np.arange(width) - u) ** 2) / (2 * sigma_px**2))
            image += np.exp(-((np.arange(height) - v) ** 2) / (2 * sigma_px**2))[:, None] * along_u
        images.append(np.where(image < 1e-3, 0, image / 2).astype(np.float32))
    return images


@pytest.mark.parametrize(("by_nodes", "roll_deg"), [(False, 0.0), (False, 5.0), (True, 5.0), (True, 90.0)])
def test_smart_equals_the_textbook(isa: str, by_nodes: bool, roll_deg: float) -> None:
    mappings = oracle.cameras(4, roll_deg)
    plan, images = make_plan(mappings, by_nodes), images_of(droplets(30), mappings)
    expected, residuals = oracle.smart(plan, images, iterations=3)
    for start in (None, oracle.start_of(plan, images).astype(np.float32)):
        result = smart(plan, images, iterations=3, start=start)
        assert_close(result.volume, expected, SMART_FROM_MLOS if start is None else SMART_FROM_START)
        np.testing.assert_allclose(result.residuals, residuals, rtol=1e-3)


@pytest.mark.parametrize("solve", [smart, mart])
@pytest.mark.parametrize("seed", range(20))
def test_any_geometry_equals_the_textbook(seed: int, solve: type(smart)) -> None:  # type: ignore[valid-type]
    rng = np.random.default_rng(seed)
    plan, mappings = random_plan(rng)
    at = rng.uniform(0, np.array(plan.grid.shape) - 1, (8, 3))
    images, relaxation = images_of(at, mappings, grid=plan.grid), rng.uniform(0.3, 1)
    expected, residuals = oracle.smart(plan, images, 3, relaxation=relaxation, by_views=solve is mart)
    start = oracle.start_of(plan, images).astype(np.float32) if rng.random() < 0.5 else None
    bounds = MART if solve is mart else SMART_FROM_MLOS if start is None else SMART_FROM_START
    out = np.empty(plan.grid.shape, (np.float32, np.float16)[rng.integers(2)])
    for name in _native.available_isas():
        with instruction_set(name):
            result = solve(plan, images, iterations=3, relaxation=relaxation, start=start, out=out)
        assert result.volume is out
        assert_close(out, expected, bounds)
        np.testing.assert_allclose(result.residuals, residuals, rtol=1e-3)


@pytest.mark.parametrize("solve", [smart, mart])
@pytest.mark.parametrize("voxel_px", [1.4, 2, 4, 7])
def test_coarse_voxels_equal_the_textbook(isa: str, voxel_px: float, solve: type(smart)) -> None:  # type: ignore[valid-type]
    grid, mappings = VoxelGrid.centred((5, 14, 22), voxel_px / 60), oracle.cameras(3, roll_deg=9.0)
    at = np.random.default_rng(7).uniform(0, np.array(grid.shape) - 1, (8, 3))
    plan, images = plan_reconstruction(mappings, grid), images_of(at, mappings, 1.5 * voxel_px, grid)
    expected, residuals = oracle.smart(plan, images, 3, by_views=solve is mart)
    result = solve(plan, images, iterations=3)
    assert_close(result.volume, expected, MART if solve is mart else SMART_FROM_MLOS)
    np.testing.assert_allclose(result.residuals, residuals, rtol=1e-3)


@pytest.mark.parametrize("shape", [(1, 40, 80), (1, 60, 60), (5, 8, 60), (2, 20, 33)], ids=str)
@pytest.mark.parametrize("azimuths_deg", [(0.0, 0.0), (30.0, -20.0, 0.0)], ids=str)
def test_no_voxel_runs_away_where_pixels_might_meet_it(
    isa: str, shape: tuple[int, int, int], azimuths_deg: tuple[float, ...]
) -> None:
    """Twenty voxels are nineteen pixels, and views along z see all planes nearly alike: pixels could meet voxels."""
    grid = VoxelGrid.centred(shape, 1 / 60)
    mappings: list[ViewMapping] = [
        view_camera(azimuth, focal_length_mm=85, magnification=0.43, scale_px_per_mm=60, image_size_px=(140, 120))
        for azimuth in azimuths_deg
    ]
    beyond = np.random.default_rng(1).uniform((0, -6, -6), np.add(shape, (-1, 5, 5)), (15, 3))
    plan, images = make_plan(mappings, False, grid), images_of(beyond, mappings, grid=grid)
    expected, residuals = oracle.smart(plan, images, 3)
    result = smart(plan, images, iterations=3)
    assert_close(result.volume, expected, SMART_FROM_MLOS)
    np.testing.assert_allclose(result.residuals, residuals, rtol=1e-3)
    assert result.residuals[-1] < result.residuals[1] < result.residuals[0]


def assert_close(volume: NDArray[Any], expected: NDArray[np.float64], bounds: tuple[float, float]) -> None:
    missed = volume - expected
    assert np.linalg.norm(missed) < bounds[0] * np.linalg.norm(expected)
    assert np.abs(missed).max() < bounds[1] * expected.max()


@pytest.mark.parametrize("by_nodes", [False, True])
@pytest.mark.parametrize("solve", [smart, mart])
def test_the_residual_falls_with_every_iteration(solve: type(smart), by_nodes: bool) -> None:  # type: ignore[valid-type]
    mappings = oracle.cameras(4)
    residuals = solve(make_plan(mappings, by_nodes), images_of(droplets(40), mappings), iterations=8).residuals
    assert len(residuals) == 9
    assert (np.diff(residuals) < 0).all()
    assert residuals[-1] < 0.5 * residuals[0]


@pytest.mark.parametrize("by_nodes", [False, True])
def test_every_droplet_is_found_and_ghosts_are_fewer_than_by_mlos(by_nodes: bool) -> None:
    positions, mappings = droplets(20), oracle.cameras(4)  # 23 per cubic millimetre: none hides another
    plan, images = make_plan(mappings, by_nodes), images_of(positions, mappings)
    start, refined = line_of_sight(plan, images), smart(plan, images).volume
    by_mlos, by_smart = (oracle.detection_rates(positions, v, 0.1 * float(v.max())) for v in (start, refined))
    assert by_smart.found == 1
    assert by_smart.ghosts <= by_mlos.ghosts
    assert by_smart.ghosts < 0.05


def test_more_views_show_fewer_ghosts() -> None:
    positions, everything = droplets(150), oracle.cameras(6)
    ghosts = []
    for count in (2, 4, 6):
        mappings = everything[:count]
        volume = smart(make_plan(mappings, False), images_of(positions, mappings), iterations=10).volume
        ghosts.append(oracle.detection_rates(positions, volume, 0.05 * float(volume.max())).ghosts)
    assert ghosts[0] > ghosts[1] > ghosts[2]


def test_smart_is_closer_to_the_truth_than_mlos() -> None:
    positions, mappings = droplets(80), oracle.cameras(4)
    z, y, x = np.moveaxis(oracle.voxel_indices(GRID), -1, 0)
    truth = np.zeros(GRID.shape)
    for at in positions:
        truth += np.exp(-((z - at[0]) ** 2 + (y - at[1]) ** 2 + (x - at[2]) ** 2) / (2 * 1.5**2))
    plan, images = make_plan(mappings, False), images_of(positions, mappings)
    by_mlos, by_smart = line_of_sight(plan, images), smart(plan, images).volume
    qualities = [quality_factor(truth, volume, window=16, step=8) for volume in (by_mlos, by_smart)]
    assert qualities[1] > qualities[0] + 0.05


def test_start_is_kept_and_its_zeros_stay() -> None:
    mappings = oracle.cameras(3)
    plan, images = make_plan(mappings, False), images_of(droplets(20), mappings)
    start = np.ones(GRID.shape, np.float32)
    start[:, :, :100] = 0
    result = smart(plan, images, iterations=2, start=start)
    assert (result.volume[:, :, :100] == 0).all()
    assert result.volume[:, :, 100:].any()
    np.testing.assert_array_equal(start[:, :, 100:], 1)


def test_the_volume_comes_in_half_precision_too(isa: str) -> None:
    mappings = oracle.cameras(3)
    plan, images = make_plan(mappings, False), images_of(droplets(20), mappings)
    half = np.full(GRID.shape, 9, np.float16)
    assert smart(plan, images, iterations=2, out=half).volume is half
    np.testing.assert_array_equal(half, smart(plan, images, iterations=2).volume.astype(np.float16))


def test_an_earlier_result_lends_its_memory_and_nothing_else() -> None:
    mappings = oracle.cameras(3)
    plan, images = make_plan(mappings, False), images_of(droplets(40), mappings)
    fewer = images_of(droplets(40)[:15], mappings)
    fresh = smart(plan, fewer, iterations=2)
    earlier = smart(plan, images, iterations=2)
    again = smart(plan, fewer, iterations=2, memory=earlier)
    np.testing.assert_array_equal(again.volume, fresh.volume)
    assert again.residuals == fresh.residuals
    assert earlier.sparse.nbytes == 0
    with pytest.raises(ValueError, match="a later volume took their memory"):
        earlier.sparse.dense()


def test_memory_of_another_grid_serves_too() -> None:
    mappings = oracle.cameras(3)
    small = plan_reconstruction(mappings, VoxelGrid.centred((20, 21, 45), GRID.pitch_mm))
    plan, images = make_plan(mappings, False), images_of(droplets(40), mappings)
    for one, other in ((plan, small), (small, plan)):
        lent = smart(other, images, iterations=1, memory=smart(one, images, iterations=1))
        np.testing.assert_array_equal(lent.volume, smart(other, images, iterations=1).volume)


@pytest.mark.parametrize("by_nodes", [False, True])
def test_blocks_are_few_and_lose_nothing(by_nodes: bool) -> None:
    mappings = oracle.cameras(4)
    plan, images = make_plan(mappings, by_nodes), images_of(droplets(12), mappings)
    views = plan.bind(plan.resample(images))
    dense = line_of_sight(plan, images)
    most = float(dense.max())
    for blocks in (
        _native.Blocks.of_views(views, GRID.shape, 1.0, 0.0, most, 2),
        _native.Blocks.of_volume(dense, most, 2),
    ):
        assert 0 < blocks.count < 0.5 * 17 * 6 * 9
        assert blocks.nbytes == blocks.count * (8 * 32 * 2 + 8)
        stored = np.full(GRID.shape, 9, np.float32)
        blocks.write(stored, 2)
        np.testing.assert_allclose(stored, dense, rtol=2**-11, atol=most * 2**-32)
        for first_row, rows in ((0, 8), (8, 13), (40, GRID.shape[1] - 40)):
            part = np.full((GRID.shape[0], rows, GRID.shape[2]), 9, np.float32)
            blocks.write(part, 2, first_row)
            np.testing.assert_array_equal(part, stored[:, first_row : first_row + rows])


@pytest.mark.parametrize("solve", [smart, mart])
def test_stop_ends_it_and_sees_the_residual(solve: type(smart)) -> None:  # type: ignore[valid-type]
    mappings = oracle.cameras(2)
    plan, images = make_plan(mappings, False), images_of(droplets(10), mappings)
    seen: list[tuple[int, float]] = []

    def stop(done: int, residual: float) -> bool:
        seen.append((done, residual))
        return done == 3

    result = solve(plan, images, iterations=9, stop=stop)
    assert [done for done, _ in seen] == [1, 2, 3]
    assert result.residuals[1:] == tuple(residual for _, residual in seen)


@pytest.mark.parametrize("solve", [smart, mart])
def test_less_relaxation_goes_slower(solve: type(smart)) -> None:  # type: ignore[valid-type]
    mappings = oracle.cameras(3)
    plan, images = make_plan(mappings, False), images_of(droplets(30), mappings)
    slow, middle, fast = (solve(plan, images, iterations=4, relaxation=r).residuals[-1] for r in (0.1, 0.3, 1.0))
    assert fast < middle < slow


@pytest.mark.parametrize("least_gain", [0.1, 0.3, 0.5, 0.9])
@pytest.mark.parametrize("solve", [smart, mart])
def test_the_first_iteration_that_gains_too_little_is_the_last(
    solve: type(smart),  # type: ignore[valid-type]
    least_gain: float,
) -> None:
    mappings = oracle.cameras(3)
    plan, images = make_plan(mappings, False), images_of(droplets(30), mappings)
    residuals, everything = (solve(plan, images, iterations=9, least_gain=g).residuals for g in (least_gain, 0.0))
    gains = 1 - np.divide(everything[1:], everything[:-1])
    iterations = int(np.argmax(gains < least_gain)) + 1
    assert gains[iterations - 1] < least_gain
    assert residuals == everything[: iterations + 1]


def test_without_least_gain_it_goes_on_even_when_the_residual_rises() -> None:
    mappings = oracle.cameras(3)
    plan, images = make_plan(mappings, False), images_of(droplets(30), mappings)
    residuals = mart(plan, images, iterations=6, relaxation=2.0).residuals
    assert len(residuals) == 7
    assert np.diff(residuals).max() > 0
    assert len(mart(plan, images, iterations=6, relaxation=2.0, least_gain=1e-6).residuals) < 7


def test_dark_images_give_an_empty_volume() -> None:
    mappings = oracle.cameras(2)
    dark = [np.zeros(mapping.image_size_px[::-1], np.float32) for mapping in mappings]
    result = smart(make_plan(mappings, False), dark, iterations=2)
    assert not result.volume.any()
    assert result.residuals == (0.0, 0.0, 0.0)


def test_what_cannot_be_done_is_refused() -> None:
    mappings = oracle.cameras(2)
    plan, images = make_plan(mappings, False), images_of(droplets(3), mappings)
    with pytest.raises(ValueError, match="iterations 0: a whole number from 1"):
        smart(plan, images, iterations=0)
    for relaxation in (0.0, 5.0, np.nan, np.inf):
        with pytest.raises(ValueError, match=f"relaxation {relaxation} must be above 0, and at most 2"):
            smart(plan, images, relaxation=relaxation)
    with pytest.raises(TypeError, match="iteration"):
        smart(plan, images, iteration=3)  # type: ignore[call-arg]
    with pytest.raises(ValueError, match=r"volume has shape \(1, 1, 1\)"):
        mart(plan, images, start=np.ones((1, 1, 1), np.float32))
    for least_gain in (-0.1, 1.0):
        with pytest.raises(ValueError, match=r"least_gain .* must be a share, 0 to 1"):
            mart(plan, images, least_gain=least_gain)
    with pytest.raises(ValueError, match="contiguous float32 or float16, not uint8"):
        smart(plan, images, out=np.zeros(GRID.shape, np.uint8))
