"""Images times s give volumes times s: no unit of intensity is built in."""

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.reconstruction.choices import ReconstructionMethod, VoxelType
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.planning.plan import Plan, plan_reconstruction
from processing.reconstruction.reconstructor import Reconstructor
from processing.reconstruction.settings import ReconstructionSettings
from processing.reconstruction.slab_volume import SLAB_ROWS
from processing.reconstruction.smart import mart, smart
from processing.volume import VoxelGrid
from tests.support import oracle

GRID = VoxelGrid.centred((9, SLAB_ROWS + 5, 37), 1 / 60)
SCALES = [1e-6, 1e-5, 0.01, 100.0, 4095.0, 1e4, 1e6]
Images = list[NDArray[np.float32]]


@pytest.fixture(scope="module")
def plan() -> Plan:
    return plan_reconstruction(oracle.cameras(4), GRID)


@pytest.fixture(scope="module")
def images(plan: Plan) -> Images:
    """Dots that differ in brightness, on black."""
    rng = np.random.default_rng(2)
    shapes = [view.image_size_px[::-1] for view in plan.views]
    return [np.where(rng.random(shape) < 0.5, 0.9 * rng.random(shape), 0).astype(np.float32) for shape in shapes]


def times(images: Images, scale: float) -> Images:
    return [image * np.float32(scale) for image in images]


@pytest.mark.parametrize("given", [False, True])
@pytest.mark.parametrize("solve", [smart, mart])
def test_a_volume_has_the_scale_of_its_images(plan: Plan, images: Images, solve: type(smart), given: bool) -> None:  # type: ignore[valid-type]
    start = np.full(GRID.shape, 3, np.float32) if given else None
    expected = solve(plan, images, iterations=3, start=start)
    for scale in SCALES:
        result = solve(plan, times(images, scale), iterations=3, start=start)
        missed = result.volume / scale - expected.volume
        assert np.linalg.norm(missed) < 2e-3 * np.linalg.norm(expected.volume), scale
        np.testing.assert_allclose(result.residuals, expected.residuals, rtol=2e-3)


@pytest.mark.parametrize("solve", [smart, mart])
@pytest.mark.parametrize("scale", [1e-30, 1e-7, 1e30])
def test_the_scale_of_a_start_does_not_matter(plan: Plan, images: Images, solve: type(smart), scale: float) -> None:  # type: ignore[valid-type]
    """MLOS of dim images is one of 1e-7."""
    start = line_of_sight(plan, images)
    expected = solve(plan, images, iterations=3, start=start).volume
    missed = solve(plan, images, iterations=3, start=start * np.float32(scale)).volume - expected
    assert np.linalg.norm(missed) < 2e-3 * np.linalg.norm(expected)


@pytest.mark.parametrize("scale", [1e-5, 1e-3, 1e5])
def test_products_of_eight_views_have_room(scale: float) -> None:
    views = plan_reconstruction(oracle.cameras(8), GRID)
    rng = np.random.default_rng(3)
    images = [(0.05 + 0.9 * rng.random(view.image_size_px[::-1])).astype(np.float32) for view in views.views]
    expected = line_of_sight(views, images, ReconstructionMethod.GAVLOS)
    found = line_of_sight(views, times(images, scale), ReconstructionMethod.GAVLOS) / scale
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=1e-3)


@pytest.mark.parametrize("solve", [smart, mart])
def test_powers_of_two_change_no_other_bit(plan: Plan, images: Images, solve: type(smart)) -> None:  # type: ignore[valid-type]
    expected = solve(plan, images, iterations=3)
    for scale in (2.0**-20, 0.5, 2.0**20):
        result = solve(plan, times(images, scale), iterations=3)
        np.testing.assert_array_equal(result.volume, expected.volume * np.float32(scale))
        assert result.residuals == expected.residuals


@pytest.mark.parametrize("voxels", VoxelType)
def test_slabs_of_any_type_keep_the_scale(plan: Plan, images: Images, voxels: VoxelType) -> None:
    def volume_of(scale: float) -> NDArray[np.float32]:
        settings = ReconstructionSettings(method=ReconstructionMethod.SMART, voxels=voxels, iterations=2)
        volume, _ = Reconstructor.of(plan, settings).reconstruct(times(images, scale))
        return np.concatenate([slab for _, slab in volume.intensities()], axis=1)

    expected = volume_of(1.0)
    assert expected.any()
    for scale in (2.0**-20, 2.0**20):
        np.testing.assert_allclose(volume_of(scale), expected * np.float32(scale), rtol=1e-6)


def test_one_dark_view_has_no_scale(plan: Plan, images: Images) -> None:
    start = np.ones(GRID.shape, np.float32)
    dark = [0 * images[0], *images[1:]]
    expected = smart(plan, dark, iterations=2, start=start).volume
    result = smart(plan, times(dark, 2.0**-20), iterations=2, start=start).volume
    np.testing.assert_array_equal(result, expected * np.float32(2.0**-20))


def test_voxels_without_room_for_an_intensity_are_refused(plan: Plan, images: Images) -> None:
    for scale in (1e-6, 1e6):
        with pytest.raises(ValueError, match="float16 has no room for intensities"):
            smart(plan, times(images, scale), iterations=1, out=np.empty(GRID.shape, np.float16))
    for dtype, scale in ((np.float16, 20.0), (np.uint8, 2.0), (np.float32, 1e10)):
        line_of_sight(plan, images, out=np.empty(GRID.shape, dtype))
        with pytest.raises(ValueError, match=f"voxels of {np.dtype(dtype).name} hold intensities up to"):
            line_of_sight(plan, times(images, scale), out=np.empty(GRID.shape, dtype))
