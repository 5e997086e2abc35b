"""How probably a found droplet is real and no ghost: by what its views say of it, and by how crowded they are.

Ghosts live on what the views have left over for chance: some view gives them less than the others do, they explain it
worse, and they are many where spots are wide and dense. A logistic regression weighs that. It was fitted to simulated
shots whose truth is known (``tests.support.fit_reality``) and tried on others (``processing.studies.real_droplets``).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.special import expit

from processing.geometry import FloatArray

TRIED_VIEWS = 4
"""So many views shots had, along lines that are apart, and knew each of the droplets."""
TWIN_DROPLETS, MOST_TWINS = 60, 5
"""Twins together have so many droplets, if so many twins do: of 12 droplets of a single one two are no share."""
CROWD_PX = 20.0
"""So far around a droplet others crowd it."""
LEAST_CROWDING, LEAST_RESIDUAL = 0.01, 0.5
"""Less counts as so much: it has no meaning, or is no less."""
SHARES = (-1.0, 2.0)
"""What a view gives over what all give together is clipped to these."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """What tells N droplets from ghosts, in K views.

    Parameters
    ----------
    together : (N,) array
        Height, or squared radius, that all views give.
    alone, alone_sd : (K, N) arrays
        What each view alone would give, all other droplets fixed, and its standard deviation.
    residual : (N,) array
        Root mean square of what is left around the droplets, over the noise.
    crowding : (N,) array
        As ``crowding`` has it.
    width_px : float
        Standard deviation of the blur, or of a spot.
    directions : int
        Along so many lines the views look.
    """

    together: FloatArray
    alone: FloatArray
    alone_sd: FloatArray
    residual: FloatArray
    crowding: FloatArray
    width_px: float
    directions: int

    @property
    def columns(self) -> FloatArray:
        """What is weighed (N, 7).

        Logarithm of the significance, significance in the view that gives the second least, least share that a view
        gives, logarithms of disagreement, residual, crowding and width.
        """
        sigmas = self.alone / self.alone_sd
        deviations = (self.alone - self.together) / self.alone_sd
        disagreement = np.sqrt(np.sum(deviations**2, axis=0) / (len(self.alone) - 1))
        return np.column_stack(
            [
                np.log(self.together * np.sqrt(np.sum(self.alone_sd**-2, axis=0))),
                np.arcsinh(np.sort(sigmas, axis=0)[1]),
                np.clip((self.alone / self.together).min(axis=0), *SHARES),
                np.log(np.maximum(1, disagreement)),
                np.log(np.maximum(self.residual, LEAST_RESIDUAL)),
                np.log(self.crowding + LEAST_CROWDING),
                np.full(len(self.together), np.log(self.width_px)),
            ]
        )


@dataclass(frozen=True)
class Reality:
    """What evidence weighs, for one kind of images.

    Parameters
    ----------
    base : float
        Logarithm of the odds where all columns are 0.
    weights : tuple of 7 floats
        Of the columns.
    widths_px : (least, most)
        That were tried.
    most_crowding : float
        That was tried.
    """

    base: float
    weights: tuple[float, ...]
    widths_px: tuple[float, float]
    most_crowding: float

    def p_real(self, evidence: Evidence, knowing: NDArray[np.int64]) -> FloatArray:
        """Probabilities (N,) that droplets are real; not a number where that was not tried.

        Parameters
        ----------
        evidence : Evidence
            What is known of them.
        knowing : (N,) int array
            How many views know something of each.
        """
        least_px, most_px = self.widths_px
        tried = (knowing == TRIED_VIEWS) & (evidence.crowding <= self.most_crowding)
        views_tried = len(evidence.alone) == evidence.directions == TRIED_VIEWS
        if not views_tried or not least_px <= evidence.width_px <= most_px:
            return np.full(len(tried), np.nan)
        return np.where(tried, expit(self.base + evidence.columns @ np.array(self.weights)), np.nan)


def twins_of(asked: int, views: int, directions: int, droplets: int) -> int:
    """How many twins to make of so many droplets.

    Where views are not four, and apart, no probability tells ghosts: there is one at least then, and as many as it
    takes for a share.
    """
    if asked or views == directions == TRIED_VIEWS:
        return asked
    return int(np.clip(-(-TWIN_DROPLETS // max(droplets, 1)), 1, MOST_TWINS))


def crowding(seen_px: FloatArray, areas_px2: FloatArray) -> FloatArray:
    """How much of the views (N,) around each droplet others cover, mean of the views.

    Parameters
    ----------
    seen_px : (K, N, 2) array
        Where the views see the droplets.
    areas_px2 : (N,) array
        Squares of their radii, blur included.
    """
    return np.asarray(np.mean([_covered(view, areas_px2) for view in seen_px], axis=0))


def _covered(seen_px: FloatArray, areas_px2: FloatArray) -> FloatArray:
    one, other = cKDTree(seen_px).query_pairs(CROWD_PX, output_type="ndarray").T
    count = len(seen_px)
    both = np.bincount(one, areas_px2[other], count) + np.bincount(other, areas_px2[one], count)
    return np.asarray(both / CROWD_PX**2)
