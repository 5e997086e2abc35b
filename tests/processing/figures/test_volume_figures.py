"""Figures show what they are given, with units on their axes."""

import io

import numpy as np
from matplotlib.figure import Figure

from processing.calibration.calibration import Calibration, Model, PlaneError, Verdict, ViewCalibration
from processing.figures.volume_figures import isosurface_figure, residuals_figure, shadowgraph_figure, slices_figure
from processing.geometry import view_camera
from processing.volume import VoxelGrid

GRID = VoxelGrid.centred((20, 30, 40), 0.1)


def ball(offset_mm: float = 0.0) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    z, y, x = np.meshgrid(GRID.z_mm, GRID.y_mm, GRID.x_mm, indexing="ij")
    return np.exp(-((x - offset_mm) ** 2 + y**2 + z**2) / 0.2).astype(np.float32)


def drawn(figure: Figure) -> int:
    """Bytes of the picture: drawing it must work without a warning."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=60)
    return len(buffer.getvalue())


def calibration_of(z_mm: list[float | None]) -> Calibration:
    """Two views with an error of 0.01 and 0.02 px at every plane."""
    camera = view_camera(0, focal_length_mm=85, magnification=0.43, scale_px_per_mm=60)
    views = {}
    for number in (1, 2):
        error_px = 0.01 * number
        planes = tuple(PlaneError(f"plane {z}", z, 391, error_px, error_px) for z in z_mm)
        views[f"view{number}"] = ViewCalibration(
            verdict=Verdict.GOOD,
            model=Model.PINHOLE,
            n_points=391,
            n_rejected=0,
            mean_error_px=error_px,
            rms_px=error_px,
            max_error_px=error_px,
            holdout_error_px=2 * error_px,
            mapping=camera,
            extent_mm=(),
            boards_in_free_poses=(),
            planes=planes,
        )
    return Calibration("id", "2026-01-01T00:00:00+00:00", None, views, (-4.5, 4.5), "test")


def test_residuals_show_every_view_and_its_holdout_error() -> None:
    figure = residuals_figure(calibration_of([-4.5, 0.0, 4.5]))
    axes = figure.axes[0]
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == [
        "view1 (hold-out 0.020 px)",
        "view2 (hold-out 0.040 px)",
    ]
    assert axes.get_xlabel() == "plane z [mm]"
    assert axes.get_ylabel() == "mean back-projection error [px]"
    np.testing.assert_allclose(np.asarray(axes.lines[1].get_ydata(), dtype=float), 0.02)
    assert drawn(figure) > 1000


def test_boards_in_free_poses_are_numbered() -> None:
    axes = residuals_figure(calibration_of([None, None])).axes[0]
    assert axes.get_xlabel() == "board"
    np.testing.assert_allclose(np.asarray(axes.lines[0].get_xdata(), dtype=float), [1, 2])


def test_slices_have_the_extent_of_the_grid() -> None:
    figure = slices_figure(ball(), GRID)
    first = figure.axes[0].images[0]
    left, right, bottom, top = first.get_extent()
    assert np.isclose([left, right, bottom, top], [-2.0, 2.0, 1.5, -1.5]).all()
    assert figure.axes[0].get_xlabel() == "x [mm]"
    assert figure.axes[1].get_ylabel() == "z [mm]"
    assert drawn(figure) > 1000


def test_isosurface_of_a_ball_has_its_radius() -> None:
    figure = isosurface_figure({"A": ball(), "B": ball(0.5)}, GRID, level=float(np.exp(-1)))
    surfaces = figure.axes[0].collections
    assert len(surfaces) == 2
    assert drawn(figure) > 1000


def test_isosurface_of_an_empty_volume_is_empty() -> None:
    figure = isosurface_figure({"A": np.zeros(GRID.shape, np.float32)}, GRID, level=0.5)
    assert len(figure.axes[0].collections) == 0


def test_shadowgraphs_of_all_views() -> None:
    figure = shadowgraph_figure({"view1": np.ones((30, 40)), "view2": np.zeros((30, 40))}, "shot 1")
    assert [axes.get_title() for axes in figure.axes] == ["view1", "view2"]
    assert drawn(figure) > 1000
