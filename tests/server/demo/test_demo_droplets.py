"""What the demonstration's truth is, as a sample of the spray."""

import numpy as np
import pytest

from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_extent import spray_extent
from processing.analysis.spray.spray_motion import spray_motion
from processing.synthetic.spray import Spray
from processing.volume import VoxelGrid
from server.demo.demo_droplets import true_sample

AXIS = SprayAxis((0.0, -8.0, 0.0), (0.0, 1.0, 0.0))
GRID = VoxelGrid((100, 10, 100), (-5.0, -1.0, -5.0), 0.1)


def cone(half_angle_deg: float, speed_mm_per_s: float) -> Spray:
    """Droplets of 40 um on a cone from the nozzle, in and behind the box."""
    azimuths, along_mm = np.meshgrid(np.linspace(0, 2 * np.pi, 24, endpoint=False), [7.2, 7.5, 7.8, 9.0])
    tangent = np.tan(np.radians(half_angle_deg))
    ways = np.stack([tangent * np.cos(azimuths), np.ones_like(azimuths), tangent * np.sin(azimuths)], -1).reshape(-1, 3)
    places_mm = np.array(AXIS.nozzle_mm) + along_mm.reshape(-1, 1) * ways
    return Spray.of_droplets(places_mm, np.full(len(ways), 0.04), speed_mm_per_s * ways)


def test_the_truth_is_asked_for_the_same_figures_as_the_measured_spray() -> None:
    """Droplets of both exposures that are in the box, with the volume of both: density and flux are of one."""
    first = cone(30, 20_000)
    truth = true_sample([first, first.advanced(1e-6)], GRID)
    assert len(truth) == 2 * 72
    assert truth.volumes_mm3.sum() == pytest.approx(2 * 100)
    extent, motion = spray_extent(truth, AXIS), spray_motion(truth, AXIS, 1000.0)
    assert extent.cone_angle_deg is not None
    assert extent.cone_angle_deg.value == pytest.approx(60, abs=0.01)
    assert motion is not None
    assert motion.mass_flux_kg_m2_s is not None
    assert motion.mass_flux_kg_m2_s.value == pytest.approx(0.72 * np.pi / 6 * 0.04**3 * 20_000, rel=1e-6)
