"""The blob kernels against float64 numpy."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from processing.analysis.droplets.gaussian_blobs import BlobImages, BlobOptics, Blobs
from processing.analysis.droplets.sight_lattice import MAX_DEVIATION_PX, SightLattice, sight_lattice
from processing.geometry import FloatArray, PinholeCamera
from processing.kernels import _native
from processing.studies.simulated_droplets import study_cameras
from tests.support.bright_scenes import GRID, IMAGE_SIZE_PX

CAMERAS = study_cameras(IMAGE_SIZE_PX)
OPTICS = BlobOptics(
    gains=np.array([1.0, 0.7, 1.2, 1.1]),
    sigmas_px=np.array([[1.0, 1.1], [0.8, 0.8], [1.5, 1.2], [2.5, 3.0]]),
    shifts_px=np.array([[0.1, 0], [0, -0.2], [0.05, 0.05], [0, 0]]),
    levels=(np.zeros(IMAGE_SIZE_PX[::-1], np.float32),) * 4,
)


def lattice() -> SightLattice:
    return sight_lattice(CAMERAS, GRID)


def blobs(count: int = 12, seed: int = 0) -> Blobs:
    rng = np.random.default_rng(seed)
    return Blobs(rng.uniform(-20, np.array(GRID.shape[::-1]) + 20, (count, 3)), rng.lognormal(0, 0.5, count))


def empty(count: int = 4) -> BlobImages:
    return BlobImages(tuple(np.zeros(IMAGE_SIZE_PX[::-1], np.float32) for _ in range(count)), lattice())


def drawn_by_numpy(camera: PinholeCamera, view: int, some: Blobs) -> FloatArray:
    rows, columns = np.mgrid[: IMAGE_SIZE_PX[1], : IMAGE_SIZE_PX[0]]
    image = np.zeros(rows.shape)
    places = camera.project(GRID.to_mm(some.positions_voxel[:, ::-1])) + OPTICS.shifts_px[view]
    for (u, v), amplitude in zip(places, some.amplitudes, strict=True):
        along_u, along_v = OPTICS.sigmas_px[view]
        bell = np.exp(-0.5 * (((columns - u) / along_u) ** 2 + ((rows - v) / along_v) ** 2))
        image += amplitude * OPTICS.gains[view] * bell
    return image


def test_blobs_are_drawn_where_the_cameras_see_them_also_at_the_edges() -> None:
    some = blobs()
    for view, image in enumerate(empty().drawn(OPTICS, some)):
        np.testing.assert_allclose(image, drawn_by_numpy(CAMERAS[view], view, some), atol=0.02)
        assert image.max() > 0.1


def test_what_is_drawn_and_subtracted_leaves_nothing() -> None:
    some, shot = blobs(), empty()
    full = BlobImages(tuple(shot.drawn(OPTICS, some)), shot.lattice)
    assert max(np.abs(image).max() for image in full.residuals(OPTICS, some)) < 1e-5


def test_the_truth_is_a_fixed_point_of_the_fit() -> None:
    some, shot = blobs(), empty()
    full = BlobImages(tuple(shot.drawn(OPTICS, some)), shot.lattice)
    fitted = full.fitted(OPTICS, some, sweeps=5, scale=1.0, tolerance=0)
    seen = np.all((some.positions_voxel > 0) & (some.positions_voxel < np.array(GRID.shape[::-1])), axis=1)
    np.testing.assert_allclose(fitted.positions_voxel[seen], some.positions_voxel[seen], atol=1e-3)
    np.testing.assert_allclose(fitted.amplitudes[seen], some.amplitudes[seen], rtol=1e-3)


def test_a_fit_from_nearby_comes_to_the_truth() -> None:
    rng = np.random.default_rng(3)
    some = Blobs(rng.uniform(10, 30, (6, 3)) * [4, 1, 2], rng.lognormal(0, 0.3, 6))
    shot = empty()
    full = BlobImages(tuple(shot.drawn(OPTICS, some)), shot.lattice)
    start = Blobs(some.positions_voxel + rng.uniform(-0.5, 0.5, (6, 3)), np.full(6, 0.5))
    fitted = full.fitted(OPTICS, start, sweeps=300, scale=1.0, tolerance=0)
    np.testing.assert_allclose(fitted.positions_voxel, some.positions_voxel, atol=0.01)
    np.testing.assert_allclose(fitted.amplitudes, some.amplitudes, rtol=0.01)


def test_no_blob_becomes_negative() -> None:
    dark = BlobImages(tuple(np.full(IMAGE_SIZE_PX[::-1], -1, np.float32) for _ in range(4)), lattice())
    assert np.all(dark.fitted(OPTICS, blobs(), sweeps=3, scale=1.0, tolerance=0).amplitudes == 0)


def test_what_is_far_away_or_no_number_harms_nothing() -> None:
    for place in (1e300, -1e9, np.nan):
        lost = Blobs(np.full((1, 3), place), np.ones(1))
        for image in empty().drawn(OPTICS, lost):
            assert not image.any()


def test_the_lattice_knows_the_mappings_between_its_nodes() -> None:
    places = np.random.default_rng(1).uniform(0, np.array(GRID.shape[::-1]) - 1, (50, 3))
    step = 0.01
    sampled = lattice()
    assert sampled.deviation_px <= MAX_DEVIATION_PX
    slopes = sampled.slopes_px(places)
    for view, camera in enumerate(CAMERAS):
        for axis in range(3):
            moved = places + step * np.eye(3)[axis]
            seen = [camera.project(GRID.to_mm(some[:, ::-1])) for some in (places, moved)]
            np.testing.assert_allclose(slopes[view, :, :, axis], (seen[1] - seen[0]) / step, atol=2e-3)


def test_supports_are_sums_over_windows() -> None:
    rng = np.random.default_rng(5)
    shot = BlobImages(tuple(rng.normal(0, 1, IMAGE_SIZE_PX[::-1]).astype(np.float32) for _ in range(4)), lattice())
    one = Blobs(np.array([[80.0, 20.0, 40.0]]), np.ones(1))
    support = shot.supports(OPTICS, one, shot.images)
    for view, image in enumerate(shot.images):
        bell = drawn_by_numpy(CAMERAS[view], view, one) / OPTICS.gains[view]
        assert support[view, 0, 0] == pytest.approx(float(np.sum(bell * image)), abs=0.02)
        assert support[view, 0, 1] == pytest.approx(float(np.sum(bell**2)), rel=1e-3)
        assert support[view, 0, 2] == pytest.approx(support[view, 0, 3], rel=0.4)


def test_peaks_are_those_of_numpy_with_one_of_equal_neighbours() -> None:
    rng = np.random.default_rng(2)
    volume = rng.integers(0, 6, (7, 9, 20)).astype(np.float32)
    volume[3, 4, 5:7] = 9
    found = {tuple(map(int, peak[:3])) for peak in _native.find_peaks(volume, 0, 9, 5.0)}
    padded = np.pad(volume, 1, constant_values=-1)
    strict = set()
    for z, y, x in np.argwhere(volume >= 5):
        around = padded[z : z + 3, y : y + 3, x : x + 3].ravel()
        if around[13] >= around.max() and not np.any(around[:13] == around[13]):
            strict.add((int(x), int(y), int(z)))
    assert found == strict
    assert (5, 4, 3) in found
    assert (6, 4, 3) not in found


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"sigmas_px": np.full((4, 2), 9.0)}, "a width beyond the window"),
        ({"gains": np.array([1, 1, np.nan, 1])}, "finite numbers"),
        ({"sigmas_px": np.zeros((4, 2))}, "must be positive"),
    ],
)
def test_kernels_refuse_optics_that_are_none(change: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        empty().drawn(replace(OPTICS, **change), blobs())
