"""Droplets in even rows are told: where they are one spacing farther on, everything looks the same."""

import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.even_rows import row_spacing_mm
from tests.support.sampled_sprays import stored_shot

STARTS_MM = np.array([(-0.6, 0.0, 0.0), (0.1, 0.11, 0.5), (0.7, 0.27, -0.4)])


def rows(spread: float = 0.01, scatter_mm: float = 0.008, way_mm: float = 0.0) -> StoredDroplets:
    """Three rows along y of eight droplets each, half a millimetre apart."""
    rng = np.random.default_rng(3)
    places = (STARTS_MM[:, None] + np.outer(np.arange(8), (0, 0.5, 0))).reshape(-1, 3) + (0, way_mm, 0)
    diameters = 50 * np.exp(spread * rng.normal(size=len(places)))
    return stored_shot(diameters, places + rng.normal(0, scatter_mm, places.shape), shot=0)


def test_the_spacing_of_rows_is_told() -> None:
    assert row_spacing_mm([rows(), rows(way_mm=0.56)]) == pytest.approx(0.5, rel=0.05)


def test_droplets_that_chance_or_their_sizes_tell_apart_are_in_no_rows() -> None:
    rng = np.random.default_rng(4)
    chance = [stored_shot(rng.normal(50, 1, count), rng.uniform(-1, 1, (count, 3)), shot=0) for count in (10, 40, 400)]
    assert [row_spacing_mm([one]) for one in (*chance, rows(spread=0.4), rows(scatter_mm=0.1))] == [None] * 5
    assert row_spacing_mm([]) is None
