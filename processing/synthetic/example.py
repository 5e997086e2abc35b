"""A small example: the target and a spray as the paper's four views see them, to try things out without a file."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.count import require_count
from processing.geometry import PinholeCamera
from processing.synthetic.paper_rig import TABLE_1, paper_cameras, paper_optics
from processing.synthetic.rendering import render_transmittance
from processing.synthetic.spray import Spray
from processing.synthetic.target import Checkerboard, render_target
from processing.synthetic.view_optics import ViewOptics

Image = NDArray[np.uint8]

BINNING = 4
TARGET = Checkerboard(columns=11, rows=7, pitch_mm=2.0)
TARGET_Z_MM = (-3.0, -1.5, 0.0, 1.5, 3.0)
DROPLETS = 60
DIAMETERS_MM = (0.2, 0.5)
HALF_EDGES_MM = (6.0, 5.0, 2.5)
"""Droplets lie in a box of this size around the origin, along x, y and z."""
LIGHT = 200.0
NOISE = 1.5
"""Grey values."""


@dataclass(frozen=True, eq=False)
class Example:
    """Images of 400 x 300 px at 15 px/mm, by view, with noise.

    Parameters
    ----------
    azimuth_deg : dict of view to angle
        Where the views stand.
    target : dict of view to dict of z_mm to (rows, columns) uint8 array
        A checkerboard of 11 x 7 inner corners, 2 mm apart, at five positions.
    background, shot : dict of view to (rows, columns) uint8 array
        The light without the spray, and with it.
    positions_mm : (N, 3) float64 array
        Where the droplets are (x, y, z).
    diameters_mm : (N,) float64 array
        How large they are.
    """

    azimuth_deg: dict[str, float]
    target: dict[str, dict[float, Image]]
    background: dict[str, Image]
    shot: dict[str, Image]
    positions_mm: NDArray[np.float64]
    diameters_mm: NDArray[np.float64]


def example(seed: int = 0) -> Example:
    """Sixty droplets of 0.2 to 0.5 mm in the paper's rig, at a quarter of its resolution.

    Parameters
    ----------
    seed : int
        One seed, one example.

    Returns
    -------
    Example
        Images and angles by view, and the truth: ``positions_mm``, ``diameters_mm``.
    """
    rng = np.random.default_rng(require_count("seed", seed))
    cameras, optics = paper_cameras(BINNING), paper_optics(BINNING)
    positions_mm = rng.uniform(-1, 1, (DROPLETS, 3)) * HALF_EDGES_MM
    diameters_mm = rng.uniform(*DIAMETERS_MM, DROPLETS)
    spray = Spray.of_droplets(positions_mm, diameters_mm)
    return Example(
        azimuth_deg={name: row.azimuth_deg for name, row in TABLE_1.items()},
        target={name: _target(camera, optics[name], rng) for name, camera in cameras.items()},
        background={name: _grey(np.ones(camera.image_size_px[::-1]), rng) for name, camera in cameras.items()},
        shot={name: _grey(render_transmittance(camera, spray, optics[name]), rng) for name, camera in cameras.items()},
        positions_mm=positions_mm,
        diameters_mm=diameters_mm,
    )


def _target(camera: PinholeCamera, optics: ViewOptics, rng: np.random.Generator) -> dict[float, Image]:
    return {z_mm: _grey(render_target(camera, TARGET, z_mm, optics), rng) for z_mm in TARGET_Z_MM}


def _grey(transmittance: NDArray[np.floating], rng: np.random.Generator) -> Image:
    light = LIGHT * transmittance + rng.normal(0, NOISE, transmittance.shape)
    return np.clip(np.rint(light), 0, 255).astype(np.uint8)
