"""Line-of-sight kernels: equal to the textbook on every instruction set, and right about droplets."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from processing.geometry import FloatArray, ViewMapping
from processing.kernels import _native
from processing.reconstruction.choices import Accuracy, ReconstructionMethod
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.planning.node_view import NodeView, sample_mapping
from processing.reconstruction.planning.plan import Plan, plan_reconstruction
from processing.volume import VoxelGrid
from tests.support import oracle
from tests.support.sight_bounds import assert_equals_textbook

METHODS = [ReconstructionMethod.GAVLOS, ReconstructionMethod.MINLOS, ReconstructionMethod.MLOS]
GRID = VoxelGrid.centred((21, 37, 275), 1 / 60)
"""Longer than a tile, not a multiple of anything."""


def random_images(mappings: list[ViewMapping], blur_px: float = 0.0, seed: int = 1) -> list[NDArray[np.float32]]:
    rng = np.random.default_rng(seed)
    images = [rng.random(mapping.image_size_px[::-1]).astype(np.float32) for mapping in mappings]
    if not blur_px:
        return images
    blurred = [cv2.GaussianBlur(image, (0, 0), blur_px) for image in images]
    return [np.clip((image - 0.45) * 10, 0.1, 1).astype(np.float32) for image in blurred]


def node_plan(mappings: list[ViewMapping], grid: VoxelGrid = GRID) -> Plan:
    return Plan(grid, tuple(sample_mapping(mapping, grid, 0.02) for mapping in mappings))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("accuracy", Accuracy)
@pytest.mark.parametrize("count", [2, 3, 4, 5, 8])
def test_rectified_views_equal_the_textbook(
    isa: str, count: int, accuracy: Accuracy, method: ReconstructionMethod
) -> None:
    mappings = oracle.cameras(count)
    plan, images = plan_reconstruction(mappings, GRID, accuracy), random_images(mappings)
    assert_equals_textbook(line_of_sight(plan, images, method), plan, images, method)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("roll_deg", [0.0, 7.0, 90.0, 180.0])
def test_mapped_views_equal_the_textbook(isa: str, roll_deg: float, method: ReconstructionMethod) -> None:
    mappings = oracle.cameras(4, roll_deg)
    plan, images = node_plan(mappings), random_images(mappings)
    assert_equals_textbook(line_of_sight(plan, images, method), plan, images, method)


@pytest.mark.parametrize("method", METHODS)
def test_both_ways_equal_the_papers_sampling_of_the_recorded_image(method: ReconstructionMethod) -> None:
    mappings = oracle.cameras(4, roll_deg=2.0)
    images = random_images(mappings, blur_px=3.0)
    expected = oracle.line_of_sight(mappings, GRID, images, method)
    for plan, tolerance in ((plan_reconstruction(mappings, GRID), 0.06), (node_plan(mappings), 1e-3)):
        error = line_of_sight(plan, images, method) - expected
        assert float(np.sqrt(np.mean(error**2))) < tolerance / 6
        assert float(np.abs(error).max()) < tolerance


@dataclass(frozen=True)
class Mirrored:
    """A view seen in a mirror."""

    inner: ViewMapping

    @property
    def image_size_px(self) -> tuple[int, int]:
        return self.inner.image_size_px

    def project(self, points_mm: FloatArray) -> FloatArray:
        image_px = self.inner.project(points_mm)
        return np.column_stack([self.image_size_px[0] - 1 - image_px[:, 0], image_px[:, 1]])


def test_a_mirror_changes_nothing_but_the_image() -> None:
    mappings = oracle.cameras(3)
    images = random_images(mappings)
    mirrored = line_of_sight(node_plan([Mirrored(m) for m in mappings]), [image[:, ::-1] for image in images])
    np.testing.assert_allclose(mirrored, line_of_sight(node_plan(mappings), images), atol=2e-4)


@settings(max_examples=15)
@given(
    position=st.tuples(st.integers(4, 16), st.integers(4, 32), st.integers(4, 270)),
    by_nodes=st.booleans(),
    method=st.sampled_from(METHODS),
)
def test_one_droplet_peaks_at_its_voxel(
    position: tuple[int, int, int], by_nodes: bool, method: ReconstructionMethod
) -> None:
    mappings = oracle.cameras(4, scale_px_per_mm=60.0)
    plan = node_plan(mappings) if by_nodes else plan_reconstruction(mappings, GRID)
    point_mm = GRID.to_mm(np.array([position], dtype=float))
    images = []
    for mapping in mappings:
        (u, v), (width, height) = mapping.project(point_mm)[0], mapping.image_size_px
        distance2 = (np.arange(width) - u) ** 2 + (np.arange(height)[:, None] - v) ** 2
        images.append(np.exp(-distance2 / 8).astype(np.float32))
    peak = np.unravel_index(np.argmax(line_of_sight(plan, images, method)), GRID.shape)
    assert np.abs(np.subtract(peak, position)).max() <= 1


@pytest.mark.parametrize("by_nodes", [False, True])
def test_nothing_is_seen_outside_of_an_image(isa: str, by_nodes: bool) -> None:
    wide = VoxelGrid.centred((9, 17, 700), 1 / 60)
    mappings = oracle.cameras(2)
    plan = node_plan(mappings, wide) if by_nodes else plan_reconstruction(mappings, wide)
    volume = line_of_sight(plan, [np.ones(m.image_size_px[::-1], np.float32) for m in mappings])
    u, _ = oracle.seen_by(mappings[0], wide)
    outside = (u < -2) | (u > mappings[0].image_size_px[0] + 1)
    assert outside.any()
    assert (volume[outside] == 0).all()
    np.testing.assert_allclose(volume[4, 8, 300:400], 1, atol=1e-4)


@pytest.mark.parametrize("method", METHODS)
def test_out_is_filled_and_returned_in_other_formats_too(isa: str, method: ReconstructionMethod) -> None:
    mappings = oracle.cameras(3)
    plan, images = plan_reconstruction(mappings, GRID), random_images(mappings)
    single = line_of_sight(plan, images, method)
    half, byte = np.full(GRID.shape, 9, np.float16), np.full(GRID.shape, 9, np.uint8)
    assert line_of_sight(plan, images, method, half) is half
    np.testing.assert_array_equal(half, single.astype(np.float16))
    line_of_sight(plan, images, method, byte)
    np.testing.assert_allclose(byte, single * 255, atol=0.501)


@pytest.mark.parametrize("accuracy", Accuracy)
def test_leaving_out_what_is_empty_changes_nothing(isa: str, accuracy: Accuracy) -> None:
    mappings = oracle.cameras(2)
    plan = plan_reconstruction(mappings, GRID, accuracy)
    rng = np.random.default_rng(3)
    images = [(rng.random(m.image_size_px[::-1]) > 0.995).astype(np.float32) for m in mappings]
    for image in images:
        image[:, :150] = 0
    resampled = plan.resample(images)
    culled, dense = np.full((2, *GRID.shape), 9, np.float32)
    _native.line_of_sight(plan.bind(resampled), "mlos", culled, 2)
    _native.line_of_sight(plan.bind(resampled, cull=False), "mlos", dense, 2)
    assert 0 < np.mean(dense > 0) < 0.1
    np.testing.assert_array_equal(culled, dense)


@settings(max_examples=20)
@given(
    shape=st.tuples(st.integers(1, 5), st.integers(1, 40), st.integers(1, 70)),
    format_=st.sampled_from([np.float32, np.float16, np.uint8]),
    by_nodes=st.booleans(),
)
def test_volumes_of_any_size_are_written_completely_and_not_beyond(
    shape: tuple[int, int, int], format_: type, by_nodes: bool
) -> None:
    mappings, grid = oracle.cameras(2), VoxelGrid.centred(shape, 1 / 60)
    plan = node_plan(mappings, grid) if by_nodes else plan_reconstruction(mappings, grid)
    ones = [np.ones(m.image_size_px[::-1], np.float32) for m in mappings]
    size = int(np.prod(shape))
    memory: NDArray[Any] = np.full(size + 16, 7, format_)
    volume = memory[8:-8].reshape(shape)
    line_of_sight(plan, ones, out=volume)
    np.testing.assert_allclose(volume, 255 if format_ is np.uint8 else 1, atol=5e-4)
    assert size == volume.size
    assert (memory[:8] == 7).all()
    assert (memory[-8:] == 7).all()


def test_coarse_voxels_see_droplets_between_them() -> None:
    coarse = VoxelGrid.centred((9, 9, 33), 8 / 60)
    mappings = oracle.cameras(3)
    plan = plan_reconstruction(mappings, coarse)
    assert all(isinstance(view, NodeView) and view.binning == 8 for view in plan.views)
    dotted = [np.zeros(m.image_size_px[::-1], np.float32) for m in mappings]
    for image in dotted:
        image[::8, ::8] = 1.0
    np.testing.assert_allclose(line_of_sight(plan, dotted)[4, 4, 12:20], (1 / 64) ** 3, rtol=1e-4)


def test_what_does_not_fit_is_refused() -> None:
    mappings = oracle.cameras(2)
    plan, images = plan_reconstruction(mappings, GRID), random_images(mappings)
    with pytest.raises(ValueError, match="smart is not a line-of-sight method"):
        line_of_sight(plan, images, ReconstructionMethod.SMART)
    with pytest.raises(ValueError, match="1 images for a plan of 2 views"):
        line_of_sight(plan, images[:1])
    with pytest.raises(ValueError, match=r"view 2: its image has shape \(5, 5\)"):
        line_of_sight(plan, [images[0], np.zeros((5, 5), np.float32)])
    with pytest.raises(ValueError, match=r"volume has shape \(2, 2, 2\)"):
        line_of_sight(plan, images, out=np.zeros((2, 2, 2), np.float32))
    with pytest.raises(ValueError, match="float32 or float16 or uint8, not float64"):
        line_of_sight(plan, images, out=np.zeros(GRID.shape))


def test_an_unknown_instruction_set_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TOMOSHADOW_ISA", "sse9")
    with pytest.raises(ValueError, match="TOMOSHADOW_ISA is sse9, this processor runs plain"):
        _native.selected_isa()
