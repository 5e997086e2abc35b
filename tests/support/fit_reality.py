"""Fit what evidence weighs for ``p_real`` to simulated shots: ``python -m tests.support.fit_reality bright|shadows``.

The weights in use are those of these cases; of shadows some had shots of further seeds, 51 to 54. Cases and seeds are
others than those of ``processing.studies.real_droplets``, which tries the outcome.
"""

import sys
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from processing.analysis.droplets import bright_shot
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.analysis.droplets.reality import TRIED_VIEWS, Evidence, Reality
from processing.analysis.droplets.shadows import shadow_table
from processing.geometry import FloatArray
from processing.studies.droplets import DropletCase
from processing.studies.real_droplets.judged_shots import judged_shot
from processing.studies.shadows.sizes import SizeCase

SEEDS = {"bright": (1, 2, 3), "shadows": (1, 2, 3)}
CASES: dict[str, tuple[DropletCase | SizeCase, ...]] = {
    "bright": (
        DropletCase(28),
        DropletCase(56),
        DropletCase(111),
        DropletCase(70, noise_percent=5),
        DropletCase(56, noise_percent=10),
        DropletCase(56, noise_percent=20),
        DropletCase(40, noise_percent=25),
        DropletCase(28, noise_percent=20),
        DropletCase(14, noise_percent=20),
        DropletCase(56, 1.5),
        DropletCase(56, 1.5, 10),
        DropletCase(20, 1.5, 20),
        DropletCase(40, 2.0),
        DropletCase(40, 2.0, 10),
        DropletCase(28, 2.0, 6),
    ),
    "shadows": (
        SizeCase(14),
        SizeCase(28),
        SizeCase(28, calibration_error_px=0.1),
        SizeCase(28, noise_percent=3),
        SizeCase(40, noise_percent=3),
        SizeCase(28, noise_percent=6),
        SizeCase(40, noise_percent=6),
        SizeCase(14, noise_percent=10),
        SizeCase(28, noise_percent=10),
        SizeCase(48, noise_percent=8),
        SizeCase(34, noise_percent=2),
        SizeCase(56, 25),
        SizeCase(56, 25, noise_percent=3),
        SizeCase(40, 30, spread=0.6, noise_percent=2),
        SizeCase(28, noise_percent=3, aperture_ratio=0.5),
        SizeCase(20, noise_percent=3, aperture_ratio=0.5),
        SizeCase(34, noise_percent=4, aperture_ratio=2 / 3),
    ),
}


class Recorder:
    """Takes the place of ``Reality``, keeps the evidence, and tells of each droplet its number instead."""

    def __init__(self) -> None:
        self.columns: FloatArray = np.empty((0, 7))

    def p_real(self, evidence: Evidence, knowing: NDArray[np.int64]) -> FloatArray:
        """Numbers (N,) of the rows of ``columns``; not a number where not all views know the droplet."""
        self.columns = evidence.columns
        return np.where(knowing == TRIED_VIEWS, np.arange(len(knowing)), np.nan)


def evidence_of(kind: str) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Evidence (N, 7), and whether droplets are real (N,), of all good shots."""
    recorder = Recorder()
    setattr(bright_shot, "REALITY", recorder)  # noqa: B010
    setattr(shadow_table, "REALITY", recorder)  # noqa: B010
    for case in CASES[kind]:
        for seed in SEEDS[kind]:
            shot = judged_shot(case, seed)
            told = np.isfinite(shot.p_real)
            ghosts = int(np.count_nonzero(~shot.real[told]))
            sys.stderr.write(f"{case.name}, seed {seed}: {shot.verdict}, {ghosts} of {told.sum()} are ghosts\n")
            if shot.verdict == ShotVerdict.GOOD:
                yield recorder.columns[shot.p_real[told].astype(int)], shot.real[told].astype(np.float64)


def fitted(columns: FloatArray, real: FloatArray) -> Reality:
    """Logistic regression, by maximum likelihood."""
    mean, scale = columns.mean(axis=0), columns.std(axis=0)
    standard = np.column_stack([np.ones(len(real)), (columns - mean) / scale])

    def unlikely(weights: FloatArray) -> tuple[float, FloatArray]:
        odds = standard @ weights
        value = float(np.sum(np.logaddexp(0, odds) - real * odds)) + 0.5 * float(np.sum(weights[1:] ** 2))
        return value, standard.T @ (expit(odds) - real) + np.concatenate([[0.0], weights[1:]])

    found = minimize(unlikely, np.zeros(standard.shape[1]), jac=True, method="BFGS").x
    weights = found[1:] / scale
    widths_px = np.exp(columns[:, 6])
    return Reality(
        base=round(float(found[0] - weights @ mean), 2),
        weights=tuple(np.round(weights, 2).tolist()),
        widths_px=(float(widths_px.min()), float(widths_px.max())),
        most_crowding=float(np.exp(np.quantile(columns[:, 5], 0.999))),
    )


if __name__ == "__main__":
    parts = list(evidence_of(sys.argv[1]))
    reality = fitted(np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts]))
    sys.stdout.write(f"{reality}\n")
