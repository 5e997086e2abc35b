"""Figures show what they are given, with units on their axes."""

import numpy as np
import pytest

from processing.figures.volume_figures import isosurface_figure, shadowgraph_figure, slices_figure
from processing.volume import VoxelGrid
from tests.support.drawing import collisions, drawn

GRID = VoxelGrid.centred((20, 30, 40), 0.1)


def ball(offset_mm: float = 0.0) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    z, y, x = np.meshgrid(GRID.z_mm, GRID.y_mm, GRID.x_mm, indexing="ij")
    return np.exp(-((x - offset_mm) ** 2 + y**2 + z**2) / 0.2).astype(np.float32)


def test_slices_have_the_extent_of_the_grid() -> None:
    figure = slices_figure(ball(), GRID)
    first = figure.axes[0].images[0]
    left, right, bottom, top = first.get_extent()
    assert np.isclose([left, right, bottom, top], [-2.0, 2.0, 1.5, -1.5]).all()
    assert figure.axes[0].get_xlabel() == "x [mm]"
    assert figure.axes[1].get_ylabel() == "z [mm]"
    assert drawn(figure) > 1000


def test_y_points_down_along_the_spray_and_z_up_as_in_other_figures() -> None:
    for axes in slices_figure(ball(), GRID).axes[:6]:
        low, high = axes.get_ylim()
        assert (low < high) == (axes.get_ylabel() == "z [mm]")


@pytest.mark.parametrize("shape", [(8, 8, 60), (30, 30, 30)])
def test_slices_stand_apart_whatever_the_volume(shape: tuple[int, int, int]) -> None:
    volume = 1e-5 * np.random.default_rng(1).random(shape, np.float32)
    assert collisions(slices_figure(volume, VoxelGrid(shape, (-112.5, 900.0, -130.0), 0.1), "mean")) == []


def test_isosurface_of_a_ball_has_its_radius() -> None:
    figure = isosurface_figure({"A": ball(), "B": ball(0.5)}, GRID, level=float(np.exp(-1)))
    surfaces = figure.axes[0].collections
    assert len(surfaces) == 2
    assert drawn(figure) > 1000


def test_isosurface_of_an_empty_volume_is_empty() -> None:
    figure = isosurface_figure({"A": np.zeros(GRID.shape, np.float32)}, GRID, level=0.5)
    assert len(figure.axes[0].collections) == 0


@pytest.mark.parametrize(("views", "title"), [(1, ""), (4, "shot 1")])
def test_shadowgraphs_of_all_views(views: int, title: str) -> None:
    names = [f"view{number}" for number in range(views)]
    figure = shadowgraph_figure({name: np.ones((1200, 1600), np.uint8) for name in names}, title)
    assert [axes.get_title() for axes in figure.axes] == names
    assert figure.axes[-1].get_xlabel() == "column [px]"
    assert collisions(figure) == []
