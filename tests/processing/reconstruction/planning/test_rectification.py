"""Resampled images equal cubic convolution through the full mapping, on every instruction set."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from processing.geometry import ViewMapping
from processing.kernels import _native
from processing.reconstruction.choices import Accuracy
from processing.reconstruction.planning.node_view import FRAME_AFTER_PX, FRAME_BEFORE_PX, NodeView, sample_mapping
from processing.reconstruction.planning.plan import MAX_DEVIATION_PX, plan_view
from processing.reconstruction.planning.rectified_view import RESAMPLING_PX, RectifiedView
from processing.volume import VoxelGrid
from tests.support import oracle, resampling_oracle
from tests.support.sight_cases import PITCH_MM, instruction_set, views

STEEPEST = 1.3 * 1.5 * np.sqrt(2)
"""Of cubic convolution, per pixel and per brightest pixel: its weights add to no more than 1.3 regardless of sign,
their derivatives to 3, of which half are positive."""


def images(size_px: tuple[int, int], seed: int) -> NDArray[np.float32]:
    """Noise, with dark regions and pixels, and a lonely one."""
    rng = np.random.default_rng(seed)
    image = np.maximum(rng.uniform(-0.2, 0.9, size_px[::-1]), 0) * rng.choice([0.1, 1.0])
    image[: rng.integers(0, 40)] = 0
    image[:, : rng.integers(0, 60)] = 0
    image[rng.integers(0, size_px[1]), rng.integers(0, size_px[0])] = rng.uniform(0.5, 3)
    return np.asarray(image, dtype=np.float32)


ROUNDING_COUNTS = 0.5 * 1.3**2 + 0.5 * (3 * 0.5 + 1.5) / 16384 * 32767 * 1.3 + 0.5 + 0.1
"""Recorded pixels and the result are rounded, by half a count, and added in single precision.

Three of the horizontal weights are rounded to half of 1 / 16384, and the fourth takes what they leave; errors that add
to nothing weigh no more than half their sum.
"""


@pytest.mark.parametrize("isa", _native.available_isas())
@settings(max_examples=60)
@given(
    mapping=views(),
    shape=st.tuples(st.integers(1, 12), st.integers(1, 40), st.integers(1, 70)),
    offset_mm=st.tuples(*[st.floats(-0.4, 0.4)] * 3),
    accuracy=st.sampled_from(Accuracy),
    seed=st.integers(0, 99),
)
def test_rectified_images_equal_the_textbook(
    isa: str,
    mapping: ViewMapping,
    shape: tuple[int, int, int],
    offset_mm: tuple[float, float, float],
    accuracy: Accuracy,
    seed: int,
) -> None:
    grid = VoxelGrid(shape, tuple(np.add(VoxelGrid.centred(shape, PITCH_MM).origin_mm, offset_mm)), PITCH_MM)
    view = plan_view(mapping, grid, accuracy)
    assume(isinstance(view, RectifiedView))
    assert isinstance(view, RectifiedView)
    recorded = images(mapping.image_size_px, seed)
    with instruction_set(isa):
        resampled = view.resample(recorded, np.empty(view.shape_px, np.int16), 2)
    assert_between_nodes(mapping, grid, view, recorded, resampled.pixels, resampled.unit, isa)
    u, v = resampling_oracle.shown_positions(mapping, grid, view, *(np.arange(float(n)) for n in view.shape_px))
    exact, _ = resampling_oracle.convolve(recorded, u, v)
    bound = ROUNDING_COUNTS + STEEPEST * 32767 * (view.deviation_px - RESAMPLING_PX + 1e-4)
    np.testing.assert_allclose(resampled.pixels, np.clip(exact / resampled.unit, 0, 32767), rtol=0, atol=bound)
    assert_limited_by_what_is_seen(recorded, u, v, resampled.brightest)


def assert_between_nodes(
    mapping: ViewMapping,
    grid: VoxelGrid,
    view: RectifiedView,
    recorded: NDArray[np.float32],
    pixels: NDArray[np.int16],
    unit: float,
    isa: str,
) -> None:
    """Where positions are linear between the same nodes, nothing is left but rounding."""
    u, v = resampling_oracle.positions_between_nodes(mapping, grid, view)
    expected, steepness = resampling_oracle.convolve(recorded, u, v)
    # nodes, their interpolation and the position in a segment: four roundings of a position in the margins
    position_px = 4 * np.spacing(np.float32(max(recorded.shape) + 128))
    missed = np.abs(pixels - np.clip(expected / unit, 0, 32767))
    assert (missed <= ROUNDING_COUNTS + position_px * steepness / unit).all()


def assert_limited_by_what_is_seen(
    recorded: NDArray[np.float32], u: oracle.Array, v: oracle.Array, most: float
) -> None:
    """Cubic convolution overshoots no further than the brightest pixel that the grid sees, or 1 if it sees none."""
    column, row = np.rint(u).astype(int), np.rint(v).astype(int)
    inside = (column >= 0) & (row >= 0) & (column < recorded.shape[1]) & (row < recorded.shape[0])
    seen = recorded[row[inside], column[inside]]
    assert most <= recorded.max() * (1 + 1e-6) or (most == pytest.approx(1) and not seen.any())
    assert most >= seen.max(initial=0) * (1 - 1e-6)


@pytest.mark.parametrize("isa", _native.available_isas())
@settings(max_examples=30)
@given(
    mapping=views(),
    voxel_px=st.floats(0.5, 8),
    seed=st.integers(0, 99),
)
def test_averaged_images_equal_the_textbook(isa: str, mapping: ViewMapping, voxel_px: float, seed: int) -> None:
    view = sample_mapping(mapping, VoxelGrid.centred((3, 5, 9), voxel_px * PITCH_MM), MAX_DEVIATION_PX)
    recorded = images(mapping.image_size_px, seed)
    with instruction_set(isa):
        resampled = view.resample(recorded, np.empty(view.shape_px, np.int16), 2)
    means = resampling_oracle.averaged(recorded, view.binning)
    assert resampled.brightest == pytest.approx(means.max() or 1, rel=1e-5)
    framed = np.pad(means, (FRAME_BEFORE_PX, FRAME_AFTER_PX))
    # half a count, and what single precision makes of a mean
    np.testing.assert_allclose(resampled.pixels, framed / resampled.unit, rtol=0, atol=0.5 + 0.05)


@settings(max_examples=30)
@given(mapping=views(), voxel_px=st.floats(0.5, 8))
def test_nodes_lead_into_the_averaged_image(mapping: ViewMapping, voxel_px: float) -> None:
    grid = VoxelGrid.centred((3, 5, 9), voxel_px * PITCH_MM)
    view = sample_mapping(mapping, grid, MAX_DEVIATION_PX)
    assert isinstance(view, NodeView)
    u, v, _ = np.moveaxis(oracle.node_values(view, grid), -1, 0)
    for seen, expected in zip((u, v), oracle.seen_by(mapping, grid), strict=True):
        # averaged pixel k, behind its frame, has its centre in the middle of the pixels it is made of
        recorded_px = (seen - FRAME_BEFORE_PX) * view.binning + (view.binning - 1) / 2
        np.testing.assert_allclose(recorded_px, expected, atol=1.1 * view.deviation_px + 1e-4)
