"""How far measured droplets are from true ones, and whether their covariance says so."""

import numpy as np

from processing.analysis.droplets.droplet_table import SizedDroplets
from processing.geometry import FloatArray
from processing.studies.droplets import place_errors, robust_sd
from processing.synthetic.spray import Spray

JUDGED_UM = (20.0, 60.0)
"""Diameters whose scatter is judged."""
SIGMAS_95 = 1.96
"""Of a normal distribution: half the width of what holds 95 %."""


def d32_of(diameters: FloatArray) -> float:
    """Sauter mean of diameters (N,), in their unit; not a number where there are none."""
    return float(np.sum(diameters**3) / np.sum(diameters**2)) if len(diameters) else float("nan")


def size_errors(droplets: SizedDroplets, truth: Spray, match: FloatArray, pitch_mm: float) -> dict[str, float]:
    """How exact droplets are, without a common motion of all, which a wrong calibration makes."""
    real = match >= 0
    if np.count_nonzero(real) < 2:
        return dict.fromkeys(("rms_voxel", "bias_um", "sd_um", "z_sd", "z_size", "held", "size_held"), float("nan"))
    errors_mm, scores = place_errors(droplets, truth.positions_mm, match)
    true_um = 1000 * truth.diameters_mm[match[real]]
    errors_um = droplets.diameters_um[real] - true_um
    judged_um = errors_um[(true_um > JUDGED_UM[0]) & (true_um < JUDGED_UM[1])]
    size_scores = errors_um / droplets.diameter_sd_um[real]
    return {
        "rms_voxel": float(np.sqrt(np.mean(errors_mm**2))) / pitch_mm,
        "bias_um": float(np.median(judged_um)),
        "sd_um": robust_sd(judged_um - np.median(judged_um)),
        "z_sd": robust_sd(scores),
        "z_size": robust_sd(size_scores - np.median(size_scores)),
        "held": float(np.mean(np.abs(scores) < SIGMAS_95)),
        "size_held": float(np.mean(np.abs(size_scores) < SIGMAS_95)),
    }
