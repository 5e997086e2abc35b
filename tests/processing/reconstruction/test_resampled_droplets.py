"""What resampling does to droplets: how far it moves them, and how much of their peak it keeps, as methods.md says."""

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.kernels import _native
from processing.reconstruction.planning.rectified_view import MAP_SPACING_PX

Array = NDArray[np.float64]
SIGMAS_PX = (0.75, 1.0, 1.25, 1.5, 2.0, 3.0, 4.0)
STEP_PX = 1 / 0.95
COLUMNS, PHASES = 64, 24
STATED_PX = 0.016
"""What plans add to their deviation for it."""


def resampled(image: NDArray[np.float32], start_px: float) -> Array:
    """The image along u, from a column on in steps of ``STEP_PX``; rows as they are."""
    rows = image.shape[0]
    v, u = np.indices(((rows - 1) // MAP_SPACING_PX + 2, COLUMNS // MAP_SPACING_PX + 1)) * float(MAP_SPACING_PX)
    nodes = np.stack([start_px + STEP_PX * u, v], axis=-1).astype(np.float32)
    out = np.empty((rows, COLUMNS), np.int16)
    unit = _native.resample(image, nodes, out, 1)
    return np.asarray(out * unit, dtype=np.float64)


def droplets(at_px: Array, columns_px: Array, sigma_px: float) -> Array:
    """A droplet per row, at any column."""
    return np.exp(-((columns_px - at_px[:, None]) ** 2) / (2 * sigma_px**2))


@pytest.mark.parametrize("sigma_px", SIGMAS_PX)
def test_droplets_stay_where_they_are_and_as_bright(isa: str, sigma_px: float) -> None:
    at_px = 40 + np.linspace(0, 1, PHASES)
    recorded = droplets(at_px, np.arange(90.0), sigma_px).astype(np.float32)
    displaced_px, kept = [], []
    for start_px in 8 + np.linspace(0, STEP_PX, PHASES):
        columns_px = start_px + STEP_PX * np.arange(COLUMNS)
        image, truth = resampled(recorded, start_px), droplets(at_px, columns_px, sigma_px)
        displaced_px.append((image @ columns_px) / image.sum(axis=1) - (truth @ columns_px) / truth.sum(axis=1))
        kept.append(np.abs(image - truth).max())
    assert np.abs(displaced_px).max() < STATED_PX
    assert np.max(kept) < {0.75: 0.11, 1.0: 0.04, 1.25: 0.02}.get(sigma_px, 0.012)


def test_a_ramp_stays_where_it_is(isa: str) -> None:
    ramp = np.tile(np.arange(90, dtype=np.float32), (16, 1))
    for start_px in (8.0, 8.3, 8.5):
        missed = resampled(ramp, start_px) - (start_px + STEP_PX * np.arange(COLUMNS))
        assert np.abs(missed).max() < 0.025
