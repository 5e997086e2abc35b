"""Residuals are drawn over the planes, beside the paper's limit."""

from dataclasses import replace

import numpy as np

from processing.calibration.calibration import Calibration, PlaneError
from processing.figures.residual_figures import residuals_figure
from processing.geometry import view_camera
from processing.studies.seen_droplets import droplet_calibration
from tests.support.drawing import drawn


def calibration_of(z_mm: list[float | None]) -> Calibration:
    """Two views with an error of 0.01 and 0.02 px at every plane."""
    camera = view_camera(0, focal_length_mm=85, magnification=0.43, scale_px_per_mm=60)
    good = droplet_calibration([camera, camera], np.ones(3))
    views = {}
    for error_px, (name, view) in zip((0.01, 0.02), good.views.items(), strict=True):
        planes = tuple(PlaneError(f"plane {z}", z, 391, error_px, error_px) for z in z_mm)
        views[name] = replace(view, planes=planes, holdout_error_px=2 * error_px)
    return replace(good, views=views)


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
