"""Medians of ligaments are as sure as they say."""

from dataclasses import replace

import numpy as np
import pytest

from processing.analysis.objects.liquid_objects import LiquidObjects, ObjectClass
from processing.analysis.objects.object_sizes import MedianSizes, median_sizes
from processing.geometry import FloatArray


def ligaments(lengths_mm: FloatArray) -> LiquidObjects:
    """A tenth as wide as they are long."""
    n = len(lengths_mm)
    some, vectors = np.ones(n), np.zeros((n, 3))
    kinds = np.full(n, str(ObjectClass.LIGAMENT))
    return LiquidObjects(
        vectors, kinds, lengths_mm, lengths_mm / 10, lengths_mm / 10, some, vectors, some, np.zeros(n, bool)
    )


def medians(shots: list[FloatArray], exposures: int | None = None) -> MedianSizes:
    told = median_sizes(list(map(ligaments, shots)), ObjectClass.LIGAMENT, exposures or len(shots))
    assert told
    return told


@pytest.mark.parametrize(("shots", "per_shot", "between"), [(1, 15, 0.0), (3, 15, 0.1), (8, 15, 0.1), (12, 8, 0.1)])
def test_intervals_hold_the_truth(shots: int, per_shot: int, between: float) -> None:
    """Shots differ by a factor of their own; of a single one nobody can know that."""
    rng, held = np.random.default_rng(1), []
    for _ in range(60):
        middles = rng.normal(0, between, shots)
        told = medians([np.exp(middle + rng.normal(0, 0.35, rng.poisson(per_shot))) for middle in middles])
        held.append(told.length_mm.low <= 1 <= told.length_mm.high)
    assert np.mean(held) >= 0.85


def test_medians_are_those_of_all_ligaments_and_of_nothing_else() -> None:
    shots = [np.array([0.3, 0.5, 0.9]), np.array([0.4, 0.7, 2.0])]
    told = medians(shots)
    assert told.length_mm.value == pytest.approx(0.6)
    assert told.width_mm.value == pytest.approx(0.06)
    sheets = [replace(one, classes=np.full(len(one), "sheet")) for one in map(ligaments, shots)]
    of_both = median_sizes([*map(ligaments, shots), *sheets], ObjectClass.LIGAMENT, 4)
    assert of_both == medians([*shots, np.empty(0), np.empty(0)])


def test_exposures_a_and_b_of_one_shot_make_nothing_surer() -> None:
    lengths_mm = np.exp(np.random.default_rng(2).normal(0, 0.35, 40))
    alone, twice = medians([lengths_mm], 1).length_mm, medians([np.repeat(lengths_mm, 2)], 2).length_mm
    assert np.log(twice.high / twice.low) == pytest.approx(np.log(alone.high / alone.low), rel=0.25)


def test_of_few_ligaments_there_is_no_interval() -> None:
    assert median_sizes([ligaments(np.ones(4))], ObjectClass.LIGAMENT, 1) is None
    assert median_sizes([], ObjectClass.LIGAMENT, 0) is None
