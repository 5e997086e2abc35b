"""Measured points, as they are imported, of a camera that is known."""

from pathlib import Path

import numpy as np

from tests.support.droplet_run import cameras


def write_points(folder: Path, noise_px: float = 0.0) -> None:
    """Three planes of points of a known camera, and the manifest that names them."""
    x_mm, y_mm, z_mm = np.meshgrid(np.linspace(-3, 3, 9), np.linspace(-2, 2, 9), [-1.5, 0, 1.5])
    points_mm = np.column_stack([x_mm.ravel(), y_mm.ravel(), z_mm.ravel()])
    seen_px = cameras()["view1"].project(points_mm)
    seen_px += np.random.default_rng(1).normal(0, noise_px, seen_px.shape)
    np.savetxt(folder / "points.txt", np.column_stack([seen_px, points_mm]))
    (folder / "manifest.toml").write_text(
        '[[calibration.points]]\ncamera = "view1"\nfile = "points.txt"\nimage_size_px = [160, 120]\n'
        'columns = ["u_px", "v_px", "x_mm", "y_mm", "z_mm"]\n'
    )
