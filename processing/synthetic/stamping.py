"""Blurred discs multiplied into an array, from tables instead of mathematics per pixel.

A disc (a ball's shadow) of radius R under a Gaussian blur sigma has, at the distance r from its centre, the
opacity P(ncx2(2, r^2 / sigma^2) < R^2 / sigma^2), one minus Marcum's Q. It depends on R / sigma and r / sigma
only, hence one table serves every disc. Radius and area of a disc are exact; its blur is that of the nearest
row of the table, within 0.5 %.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import chndtr

from processing.kernels import _native

FloatArray = NDArray[np.float64]
FloatImage = NDArray[np.float32]

_COMPUTED_RATIOS = np.geomspace(0.05, 400, 220)
_ROWS_PER_COMPUTED = 4
_RATIOS = np.geomspace(0.05, 400, _ROWS_PER_COMPUTED * (len(_COMPUTED_RATIOS) - 1) + 1)
"""Radius / sigma of each row of the table, 1 % apart; beyond, the edge of a disc is sharp enough."""
_COLUMNS = 1024
_REACH_SIGMAS = 4.0
"""A disc ends where its opacity is below 4e-5; what lies beyond is 3e-4 of its area or less."""


@dataclass(frozen=True, eq=False)
class Discs:
    """Blurred discs (D = 2) or balls (D = 3) in index coordinates of an array.

    Parameters
    ----------
    centres : (N, D) array
        Centres in the order of the array's axes; pixel centres at integers.
    radii_px : (N,) array
        Radii, in units of the array's pitch.
    sigmas_px : (N,) array
        Standard deviation of the Gaussian blur.
    opacities : (N,) array
        Opacity of the unblurred disc, 0 to 1.
    smears : (N, D) array
        Path of each centre during the exposure; ``centres`` is its middle.
    """

    centres: FloatArray
    radii_px: FloatArray
    sigmas_px: FloatArray
    opacities: FloatArray
    smears: FloatArray

    def select(self, rows: NDArray[np.intp]) -> "Discs":
        """The discs of these rows."""
        return Discs(
            self.centres[rows], self.radii_px[rows], self.sigmas_px[rows], self.opacities[rows], self.smears[rows]
        )


def stamp_discs(discs: Discs, shape: tuple[int, ...], sampled_finely: bool = False) -> FloatImage:
    """Transmittance 0..1 of all discs; where they overlap, their transmittances multiply.

    A smeared disc is the mean of two, at the nodes of Gauss-Legendre's rule on its path: exact second moment.

    Parameters
    ----------
    discs : Discs
        Discs of as many dimensions as ``shape``, 2 or 3; those outside the array are left out.
    shape : tuple[int, ...]
        Shape of the result.
    sampled_finely : bool
        Take each opacity as the mean of four places, a quarter of a pixel off its middle along the last two axes.
    """
    transmittance = np.ones(shape, np.float32)
    _native.stamp(transmittance.reshape((-1, *shape[-2:])), _stamps(discs), _profiles(), sampled_finely)
    return transmittance


@lru_cache(maxsize=1)
def _profiles() -> FloatImage:
    """Opacity against squared distance, one row per radius / sigma; the last column is 0."""
    ratios = _COMPUTED_RATIOS[:, None]
    squared = np.linspace(0, 1, _COLUMNS) * (ratios + _REACH_SIGMAS) ** 2
    computed = chndtr(ratios**2, 2.0, squared)
    computed[:, -1] = 0
    shares = (np.arange(_ROWS_PER_COMPUTED) / _ROWS_PER_COMPUTED)[:, None]
    between = computed[:-1, None] + shares * np.diff(computed, axis=0)[:, None]
    profiles = np.vstack([between.reshape(-1, _COLUMNS), computed[-1:]])
    # What is cut off at the end of a row and between the computed ones, 1e-3 at most: the area is exact.
    areas = np.trapezoid(profiles, dx=1 / (_COLUMNS - 1), axis=1) * (_RATIOS + _REACH_SIGMAS) ** 2
    return np.asarray(np.minimum(profiles * (_RATIOS**2 / areas)[:, None], 1), dtype=np.float32)


def _stamps(discs: Discs) -> FloatArray:
    """What the kernel takes of each disc, (N, 10): an image is the plane 0 of a volume."""
    steps = np.log(discs.radii_px / discs.sigmas_px / _RATIOS[0]) / np.log(_RATIOS[1] / _RATIOS[0])
    rows = np.clip(np.rint(steps), 0, len(_RATIOS) - 1).astype(np.intp)
    reach_px = discs.radii_px / _RATIOS[rows] * (_RATIOS[rows] + _REACH_SIGMAS)
    in_volume = ((0, 0), (3 - discs.centres.shape[1], 0))
    return np.column_stack(
        [
            np.pad(discs.centres, in_volume),
            np.pad(discs.smears, in_volume),
            reach_px,
            (_COLUMNS - 1) / reach_px**2,
            discs.opacities,
            rows,
        ]
    )
