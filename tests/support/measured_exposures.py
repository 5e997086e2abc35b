"""Exposures as ``measure`` would give them, of droplets that are known."""

import numpy as np

from processing.analysis.droplets.bright_shot import SeenView
from processing.analysis.droplets.droplet_table import Droplets
from processing.analysis.droplets.measured_exposure import MeasuredExposure, ShotVerdict
from processing.volume import VoxelGrid
from tests.support.moving_droplets import Exposed

PITCH_MM = 1 / 60
GRID = VoxelGrid((200, 80, 300), (-2.0, 1.0, 0.5), PITCH_MM)
Exposure = MeasuredExposure[Droplets, SeenView]


def measured(
    exposed: Exposed, grid: VoxelGrid = GRID, verdict: ShotVerdict = ShotVerdict.GOOD, p_ghost: float = 1.0
) -> Exposure:
    """Droplets of a grid; ghosts are told to be real with a probability."""
    seen, count = exposed.droplets, len(exposed.labels)
    droplets = Droplets(
        points_mm=seen.places * grid.pitch_mm + grid.origin_mm,
        covariance_mm2=seen.covariance * grid.pitch_mm**2,
        amplitudes=np.exp(seen.log_sizes),
        amplitude_sd=np.zeros(count),
        views=np.full(count, 4),
        residual=np.ones(count),
        p_real=np.where(exposed.labels < 0, p_ghost, 1.0),
    )
    reasons = () if verdict is ShotVerdict.GOOD else ("because",)
    return MeasuredExposure(droplets, {}, 1.0, verdict, reasons)
