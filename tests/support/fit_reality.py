"""Fit what evidence weighs for ``p_real`` to simulated shots: ``python -m tests.support.fit_reality bright|shadows``.

What it printed is in use; of shadows since before their blur came to rest, as new weights are no better
(``shadow_table.REALITY``). Cases and seeds are others than those of ``processing.studies.real_droplets``, which
tries the outcome.
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

SEEDS = (1, 2, 3)
BRIGHT = (
    *((28, 1, 3), (56, 1, 3), (111, 1, 3), (70, 1, 5), (56, 1, 10), (56, 1, 20), (40, 1, 25), (28, 1, 20), (14, 1, 20)),
    *((56, 1.5, 3), (56, 1.5, 10), (20, 1.5, 20), (40, 2, 3), (40, 2, 10), (28, 2, 6)),
)
"""Density per mm3, width in px, noise in percent."""
DARK = (
    *((14, 40, 1.2, 1), (28, 40, 1.2, 1), (28, 40, 3, 1), (40, 40, 3, 1), (28, 40, 6, 1), (40, 40, 6, 1)),
    *((14, 40, 10, 1), (28, 40, 10, 1), (48, 40, 8, 1), (34, 40, 2, 1), (56, 25, 1.2, 1), (56, 25, 3, 1)),
    *((28, 40, 3, 0.5), (20, 40, 3, 0.5), (34, 40, 4, 2 / 3)),
)
"""Density per mm3, median diameter in um, noise in percent, aperture over that of the paper's lenses."""
CASES: dict[str, tuple[DropletCase | SizeCase, ...]] = {
    "bright": tuple(DropletCase(density, width, noise) for density, width, noise in BRIGHT),
    "shadows": (
        *(SizeCase(n, median, noise_percent=noise, aperture_ratio=ratio) for n, median, noise, ratio in DARK),
        SizeCase(28, calibration_error_px=0.1),
        SizeCase(40, 30, spread=0.6, noise_percent=2),
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
        for seed in SEEDS:
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
