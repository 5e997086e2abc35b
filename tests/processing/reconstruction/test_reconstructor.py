"""Reconstructors: slabs of any type are the volume of each method, exposure after exposure in the same memory."""

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

GRID = VoxelGrid.centred((9, 2 * SLAB_ROWS + 5, 37), 1 / 60)
Images = list[NDArray[np.float32]]


@pytest.fixture
def plan() -> Plan:
    return plan_reconstruction(oracle.cameras(3), GRID)


def exposure(plan: Plan, seed: int) -> Images:
    """Dots that differ in brightness, on black."""
    rng = np.random.default_rng(seed)
    shapes = [view.image_size_px[::-1] for view in plan.views]
    return [np.where(rng.random(shape) < 0.7, rng.random(shape), 0).astype(np.float32) for shape in shapes]


def reconstructor_of(plan: Plan, method: ReconstructionMethod, voxels: VoxelType) -> Reconstructor:
    return Reconstructor.of(plan, ReconstructionSettings(method=method, voxels=voxels, iterations=2))


def volume_of(reconstructor: Reconstructor, images: Images) -> tuple[NDArray[np.float32], float]:
    """The whole volume, and its unit."""
    volume, _ = reconstructor.reconstruct(images)
    return np.concatenate([slab for _, slab in volume.intensities()], axis=1), volume.unit


def expected_of(plan: Plan, method: ReconstructionMethod, images: Images) -> NDArray[np.float32]:
    if not method.iterative:
        return np.asarray(line_of_sight(plan, images, method))
    solve = smart if method is ReconstructionMethod.SMART else mart
    return np.asarray(solve(plan, images, iterations=2).volume)


@pytest.mark.parametrize("voxels", VoxelType)
@pytest.mark.parametrize("method", ReconstructionMethod)
def test_slabs_are_the_volume(plan: Plan, method: ReconstructionMethod, voxels: VoxelType) -> None:
    reconstructor = reconstructor_of(plan, method, voxels)
    for seed in (1, 2, 1):
        images = exposure(plan, seed)
        volume, unit = volume_of(reconstructor, images)
        expected = expected_of(plan, method, images)
        assert expected.max() > 0.1
        if voxels is VoxelType.FLOAT32:
            np.testing.assert_array_equal(volume, expected)
        elif voxels is VoxelType.FLOAT16:
            np.testing.assert_allclose(volume, expected, rtol=2.0**-11, atol=2.0**-25)
        else:
            np.testing.assert_allclose(volume, expected, atol=0.57 * unit)  # half a step, and half one of float16
            assert volume.max() == pytest.approx(expected.max() if method.iterative else volume.max(), rel=1e-3)


@pytest.mark.parametrize("voxels", [VoxelType.FLOAT32, VoxelType.UINT8])
@pytest.mark.parametrize("method", ReconstructionMethod)
def test_any_number_of_threads_gives_the_same_bits(plan: Plan, method: ReconstructionMethod, voxels: VoxelType) -> None:
    settings = ReconstructionSettings(method=method, voxels=voxels, iterations=2)
    volumes = []
    for threads in (1, 2, 7, 40):
        reconstructor = Reconstructor.of(plan, settings, threads)
        assert reconstructor.threads == threads
        volumes.append(volume_of(reconstructor, exposure(plan, 1))[0])
    for volume in volumes[1:]:
        np.testing.assert_array_equal(volume, volumes[0])


@pytest.mark.parametrize("voxels", VoxelType)
def test_an_empty_exposure_is_an_empty_volume(plan: Plan, voxels: VoxelType) -> None:
    for method in (ReconstructionMethod.MLOS, ReconstructionMethod.SMART):
        reconstructor = reconstructor_of(plan, method, voxels)
        volume_of(reconstructor, exposure(plan, 1))
        volume, unit = volume_of(reconstructor, [np.zeros(view.image_size_px[::-1], np.float32) for view in plan.views])
        assert unit > 0
        assert not volume.any()


@pytest.mark.parametrize("method", [ReconstructionMethod.MLOS, ReconstructionMethod.SMART])
def test_one_slab_of_memory_is_enough(plan: Plan, method: ReconstructionMethod) -> None:
    reconstructor = reconstructor_of(plan, method, VoxelType.FLOAT16)
    assert reconstructor.memory.nbytes == 9 * SLAB_ROWS * 37 * 2
    volume, _ = reconstructor.reconstruct(exposure(plan, 1))
    assert all(np.shares_memory(slab, reconstructor.memory) for _, slab in volume.slabs)


@pytest.mark.parametrize("method", ReconstructionMethod)
def test_the_next_exposure_takes_the_memory_and_the_earlier_says_so(plan: Plan, method: ReconstructionMethod) -> None:
    reconstructor = reconstructor_of(plan, method, VoxelType.FLOAT32)
    earlier, _ = reconstructor.reconstruct(exposure(plan, 1))
    slabs = iter(earlier.slabs)
    next(slabs)
    volume, _ = volume_of(reconstructor, exposure(plan, 2))
    assert volume.any()
    with pytest.raises(RuntimeError, match="exposure 1 are gone: exposure 2 took their memory"):
        next(slabs)


@pytest.mark.parametrize("method", ReconstructionMethod)
def test_images_may_change_once_they_are_taken(plan: Plan, method: ReconstructionMethod) -> None:
    images = exposure(plan, 1)
    volume, _ = reconstructor_of(plan, method, VoxelType.FLOAT32).reconstruct(images)
    expected = expected_of(plan, method, images)
    for image in images:
        image.fill(0)
    np.testing.assert_array_equal(np.concatenate([slab for _, slab in volume.intensities()], axis=1), expected)


@pytest.mark.parametrize("method", ReconstructionMethod)
def test_dim_images_keep_the_voxels_of_bright_ones(plan: Plan, method: ReconstructionMethod) -> None:
    """256 steps are those of the volume, not of full scale: MLOS of four views at 3 % would have none of them."""
    images = exposure(plan, 1)
    dim = [np.float32(2.0**-5) * image for image in images]
    for voxels in (VoxelType.UINT8, VoxelType.FLOAT16):
        bright, volume = (volume_of(reconstructor_of(plan, method, voxels), some)[0] for some in (images, dim))
        atol = 1.1 / 255 if voxels is VoxelType.UINT8 else 0
        np.testing.assert_allclose(volume / volume.max(), bright / bright.max(), atol=atol, rtol=2e-3)


@pytest.mark.parametrize("method", [ReconstructionMethod.MLOS, ReconstructionMethod.SMART])
def test_what_bytes_have_no_room_for_is_counted(plan: Plan, method: ReconstructionMethod) -> None:
    images = [np.float32(0.2) * image for image in exposure(plan, 1)]
    for image in images:
        image[image.shape[0] // 2, image.shape[1] // 2] = 1
    volume, _ = reconstructor_of(plan, method, VoxelType.UINT8).reconstruct(images)
    kept = np.concatenate([slab * np.float32(volume.unit) for _, slab in volume.slabs], axis=1)
    expected = expected_of(plan, method, images)
    assert volume.losses is not None
    assert volume.losses.intensity_share == pytest.approx(expected[kept == 0].sum() / expected.sum(), rel=0.02)
    assert volume.losses.voxel_share == pytest.approx((expected[kept == 0] > 0).sum() / (expected > 0).sum(), rel=0.05)
    assert volume.losses.intensity_share > 0.002
