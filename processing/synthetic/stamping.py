"""Blurred discs multiplied into an array, from tables instead of mathematics per pixel.

A disc (a ball's shadow) of radius R under a Gaussian blur sigma has, at the distance r from its centre, the
opacity P(ncx2(2, r^2 / sigma^2) < R^2 / sigma^2), one minus Marcum's Q. It depends on R / sigma and r / sigma
only, hence one table serves every disc. Radius and area of a disc are exact; its blur is that of the nearest
row of the table, within 2.1 %.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.special import chndtr

FloatArray = NDArray[np.float64]
FloatImage = NDArray[np.float32]
Scalar = TypeVar("Scalar", bound=np.generic)

_RATIOS = np.geomspace(0.05, 50, 169)
"""Radius / sigma of each row of the table, 4.2 % apart."""
_COLUMNS = 2048
_REACH_SIGMAS = 3.5
"""A disc ends where its opacity is below 3e-4."""
_CHUNK_ELEMENTS = 1 << 18
"""Pixels per step: the temporaries stay in the L2 cache."""
_GAUSS_NODE = 1 / np.sqrt(12)
"""Two-point Gauss-Legendre nodes on a smear of length 1, from its middle: exact second moment."""


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

    @property
    def reach_px(self) -> FloatArray:
        """Distance from the centre beyond which a disc is transparent, (N,)."""
        smear_px = 0.5 * np.abs(self.smears).max(axis=1)
        return np.asarray(self.radii_px + _REACH_SIGMAS * 1.021 * self.sigmas_px + smear_px, dtype=np.float64)


def stamp_discs(discs: Discs, shape: tuple[int, ...]) -> FloatImage:
    """Transmittance 0..1 of all discs; where they overlap, their transmittances multiply.

    Parameters
    ----------
    discs : Discs
        Discs of as many dimensions as ``shape``; those outside the array are left out.
    shape : tuple[int, ...]
        Shape of the result.
    """
    transmittance = np.ones(shape, np.float32)
    for half_width, rows in _groups(discs, shape):
        _stamp(transmittance, discs.select(rows), half_width)
    return transmittance


@lru_cache(maxsize=1)
def _profiles() -> FloatImage:
    """Opacity against squared distance, one row per radius / sigma; the last column is 0."""
    ratios = _RATIOS[:, None]
    squared = (np.arange(_COLUMNS) + 0.5) / _COLUMNS * (ratios + _REACH_SIGMAS) ** 2
    profiles = chndtr(ratios**2, 2.0, squared).astype(np.float32)
    profiles[:, -1] = 0
    return profiles


def _groups(discs: Discs, shape: tuple[int, ...]) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """Rows of visible discs with a common half width of their window, in chunks that fit the cache."""
    reach_px = discs.reach_px[:, None]
    visible = np.all((discs.centres > -reach_px) & (discs.centres < np.array(shape) - 1 + reach_px), axis=1)
    half_widths = np.ceil(discs.reach_px + 0.5).astype(np.int64)
    for half_width in np.unique(half_widths[visible]):
        rows = np.flatnonzero(visible & (half_widths == half_width))
        chunk = max(1, _CHUNK_ELEMENTS // int(2 * half_width + 1) ** len(shape))
        for start in range(0, len(rows), chunk):
            yield int(half_width), rows[start : start + chunk]


def _stamp(transmittance: FloatImage, discs: Discs, half_width: int) -> None:
    window = np.rint(discs.centres).astype(np.intp)[:, :, None] + np.arange(-half_width, half_width + 1)
    smeared = bool(np.any(np.abs(discs.smears) > 1e-3))
    nodes = (-_GAUSS_NODE, _GAUSS_NODE) if smeared else (0.0,)
    opacity = sum(_opacity(discs, window, node, transmittance.shape) for node in nodes)
    weight = (discs.opacities / len(nodes)).astype(np.float32).reshape(-1, *[1] * transmittance.ndim)
    np.multiply.at(
        transmittance.reshape(-1), _flat_index(window, transmittance.shape).ravel(), (1 - weight * opacity).ravel()
    )


def _opacity(discs: Discs, window: NDArray[np.intp], node: float, shape: tuple[int, ...]) -> FloatImage:
    """Opacity of fully opaque discs on their windows, (N, w, w) or (N, w, w, w); 0 outside the array."""
    rows = np.abs(np.log(_RATIOS) - np.log(discs.radii_px / discs.sigmas_px)[:, None]).argmin(axis=1)
    unit_px = discs.radii_px / _RATIOS[rows]
    scale = _COLUMNS / (unit_px * (_RATIOS[rows] + _REACH_SIGMAS)) ** 2
    columns = np.zeros((1,), np.float32)
    for axis, size in enumerate(shape):
        centre = discs.centres[:, axis] + node * discs.smears[:, axis]
        squared = (window[:, axis] - centre[:, None]) ** 2 * scale[:, None]
        squared[(window[:, axis] < 0) | (window[:, axis] >= size)] = np.inf
        columns = columns + _along(squared.astype(np.float32), axis, len(shape))
    np.minimum(columns, np.float32(_COLUMNS - 1), out=columns)
    index = columns.astype(np.int32) + (rows * _COLUMNS).astype(np.int32).reshape(-1, *[1] * len(shape))
    return np.asarray(_profiles().reshape(-1).take(index), dtype=np.float32)


def _flat_index(window: NDArray[np.intp], shape: tuple[int, ...]) -> NDArray[np.intp]:
    """Index into the flat array of every pixel of every window; pixels outside are clipped onto the border."""
    index = np.zeros((1,), np.intp)
    for axis, size in enumerate(shape):
        stride = int(np.prod(shape[axis + 1 :], dtype=np.int64))
        index = index + _along(np.clip(window[:, axis], 0, size - 1) * stride, axis, len(shape))
    return index


def _along(values: NDArray[Scalar], axis: int, dimensions: int) -> NDArray[Scalar]:
    """(N, w) as (N, 1.., w, ..1) with w at the given axis of a window."""
    return values.reshape(len(values), *[-1 if other == axis else 1 for other in range(dimensions)])
