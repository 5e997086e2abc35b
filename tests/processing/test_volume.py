"""VoxelGrid: indices and millimetres are inverse to each other."""

from typing import Any

import numpy as np
import pytest

from processing.volume import VoxelGrid


def test_centred_grid_has_its_centre_at_the_origin() -> None:
    grid = VoxelGrid.centred((541, 1036, 1081), 1 / 60)
    for axis_mm, extent_mm in ((grid.x_mm, 18.0), (grid.y_mm, 17.25), (grid.z_mm, 9.0)):
        assert axis_mm[0] == pytest.approx(-axis_mm[-1])
        assert axis_mm[-1] - axis_mm[0] == pytest.approx(extent_mm)


def test_index_order_is_zyx_and_round_trips() -> None:
    grid = VoxelGrid((4, 5, 6), (1.0, 2.0, 3.0), 0.5)
    points_mm = np.array([[1.5, 2.0, 3.0], [1.0, 3.0, 3.0], [1.0, 2.0, 4.5]])
    indices = grid.to_index(points_mm)
    np.testing.assert_allclose(indices, [[0, 0, 1], [0, 2, 0], [3, 0, 0]])
    np.testing.assert_allclose(grid.to_mm(indices), points_mm)


def test_impossible_grid_is_refused() -> None:
    with pytest.raises(ValueError, match="grid: pitch 0: a finite number above 0"):
        VoxelGrid((1, 1, 1), (0, 0, 0), 0)


@pytest.mark.parametrize(
    ("shape", "origin_mm", "pitch_mm"),
    [
        ((3, 3, 3), (0.0, 0.0, 0.0), float("nan")),
        ((3, 3, 3), (0.0, 0.0, 0.0), float("inf")),
        ((3, 3, 3), (0.0, float("nan"), 0.0), 0.1),
        ((3.5, 3, 3), (0.0, 0.0, 0.0), 0.1),
    ],
)
def test_a_grid_lies_somewhere(shape: Any, origin_mm: tuple[float, float, float], pitch_mm: float) -> None:
    with pytest.raises(ValueError, match="grid: "):
        VoxelGrid(shape, origin_mm, pitch_mm)
